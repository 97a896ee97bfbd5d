"""The keys of `recording`: where logs go, into which pieces, how long they stay."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from motorctl.config.keys import Keys

Megabytes = Annotated[float, Field(ge=1, le=1e9)]
"""Of 10^6 bytes, as disks are sold."""
DEFAULT_DURATION_H = 1.0
DEFAULT_SIZE_MB = 2000.0
"""A part that is made a log within minutes, and of which `diagnose` can take a good piece."""
MOST_RESERVE_MB = 500.0
"""What the largest usual log needs to be made smaller."""
RESERVE_SHARE = 0.05


class FlightRecorderSettings(Keys):
    """What is kept of a fault: a log of the seconds around it, written when it happens."""

    before_s: Annotated[float, Field(ge=0.1, le=6)] = Field(
        default=5.0, description="seconds before the fault; the loop's memory holds 8 in all"
    )
    after_s: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.5, description="seconds after it: how the axes came to rest"
    )
    keep_records: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=100, description="how many are kept; the oldest are removed, never the newest"
    )
    max_size_mb: Annotated[float, Field(ge=1, le=1e6)] = Field(
        default=1000.0, description="how large they may be together"
    )


class RotationSettings(Keys):
    """When the recorder closes a log and goes on in the next one, between two rows."""

    max_size_mb: Megabytes | None = Field(
        default=DEFAULT_SIZE_MB,
        description="largest log, as it is while it is recorded; closed it takes about a quarter; "
        "null: no limit",
    )
    max_duration_h: Annotated[float, Field(ge=1 / 60, le=1e5)] | None = Field(
        default=DEFAULT_DURATION_H, description="longest log; null: no limit"
    )


class RetentionSettings(Keys):
    """Which closed logs are removed, the oldest first; null: none for this reason."""

    max_age_days: Annotated[float, Field(gt=0, le=1e5)] | None = Field(
        default=None, description="logs whose last row is older are removed"
    )
    max_total_size_mb: Megabytes | None = Field(
        default=None, description="how large all logs of this machine may be together"
    )
    min_free_mb: Megabytes | None = Field(
        default=None, description="free space that is kept by removing the oldest logs"
    )


class DiskSettings(Keys):
    """What happens while the disk becomes full."""

    warn_below_h: Annotated[float, Field(ge=0, le=1e5)] = Field(
        default=24.0, description="warn when recording can go on for less than so many hours"
    )
    stop_below_mb: Annotated[float, Field(ge=0, le=1e9)] | None = Field(
        default=None,
        description="recording stops while less is free, and goes on in a new log afterwards, so "
        "that the computer goes on working and closed logs can be made smaller; null: 500, or if "
        "that is less a twentieth of the disk, or half of retention.min_free_mb",
    )


class RecordingKeys(Keys):
    """Where logs go, into which pieces, how long they stay."""

    directory: Path = Field(
        default=Path("logs"), description="relative to the directory that motorctl is started in"
    )
    while_off: Literal["record", "pause"] = Field(
        default="record",
        description="pause: no rows while every axis is off; a fault is not off, and is recorded",
    )
    rotate: RotationSettings = Field(
        default_factory=RotationSettings, description="when a log is closed and the next begun"
    )
    retention: RetentionSettings = Field(
        default_factory=RetentionSettings, description="which closed logs are removed; none"
    )
    disk: DiskSettings = Field(
        default_factory=DiskSettings, description="what happens while the disk becomes full"
    )
    flight_recorder: FlightRecorderSettings = Field(
        default_factory=FlightRecorderSettings, description="what is kept of a fault"
    )

    def reserve_mb(self, disk_mb: float) -> float:
        """Return below which free space recording stops [MB].

        Parameters
        ----------
        disk_mb
            Size of the disk [MB].
        """
        if self.disk.stop_below_mb is not None:
            return self.disk.stop_below_mb
        kept = self.retention.min_free_mb
        # Retention comes first where it keeps some space free.
        return min(MOST_RESERVE_MB, RESERVE_SHARE * disk_mb, math.inf if kept is None else kept / 2)
