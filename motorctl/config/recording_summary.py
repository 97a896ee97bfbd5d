"""The arithmetic of a recording: megabytes an hour, logs a day, how long the store lasts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from motorctl.config.machine import Machine
from motorctl.config.recording_keys import RecordingKeys
from motorctl.config.recording_rules import (
    CLOSED_SHARE,
    RecordingRate,
    largest_log_mb,
    recording_rate,
)

HOURS_A_DAY = 24.0
DAYS_A_YEAR = 365.0


def recording_rate_of(machine: Machine) -> RecordingRate:
    """Return how much a machine records."""
    axes = (
        (len(axis.model), axis.dual_drive is not None, axis.learning is not None)
        for axis in machine.axes.values()
    )
    return recording_rate(axes, machine.rate_hz)


def recording_summary(recording: RecordingKeys, rate: RecordingRate) -> dict[str, Any]:
    """Return the keys as they are, and what they come to while nothing is left out.

    Parameters
    ----------
    recording
        The part `recording` of a configuration.
    rate
        What the machine records.
    """
    largest = largest_log_mb(recording, rate)
    total, age = recording.retention.max_total_size_mb, recording.retention.max_age_days
    closed_mb_day = rate.closed_mb_h * HOURS_A_DAY
    # Of the total, the log that is recorded takes its full size.
    kept_days = None if total is None else (total - (largest or 0.0)) / closed_mb_day
    if age is not None:
        kept_days = age if kept_days is None else min(kept_days, age)
    return {
        **recording.model_dump(mode="json", exclude={"flight_recorder"}),
        "row_bytes": rate.row_bytes,
        "recorded_mb_h": rate.recorded_mb_h,
        "closed_mb_h": rate.closed_mb_h,
        "closed_gb_year": closed_mb_day * DAYS_A_YEAR / 1e3,
        "largest_log_mb": largest,
        "log_h": None if largest is None else largest / rate.recorded_mb_h,
        "kept_days": kept_days,
    }


def notes_on_recording(recording: RecordingKeys, rate: RecordingRate) -> Iterator[str]:
    """Yield what is allowed, and will surprise."""
    largest = largest_log_mb(recording, rate)
    if largest is None:
        yield "recording: without rotate a run is one log, made smaller only when the daemon stops"
        return
    stop, closed = recording.reserve_mb(math.inf), largest * CLOSED_SHARE
    if closed > stop:
        yield (
            f"recording: on a full disk a log of {largest:.0f} MB needs {closed:.0f} MB to be made "
            f"smaller, and disk.stop_below_mb leaves {stop:g}"
        )
