"""How long recording can go on: the rate at which it takes space, and the space that is left.

And how many files can still be made, which may be none on a disk with much space.
"""

from __future__ import annotations

import math
import os
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from motorctl.config.recording_keys import RecordingKeys
from motorctl.config.recording_rules import (
    CLOSED_SHARE,
    MEGABYTE,
    RecordingRate,
    largest_log_mb,
)

WINDOW_S = 600.0
"""The present rate is that of the last ten minutes: long for a motion, short for a shift."""
KNOWN_AFTER_S = 10.0
"""Until then the rate is what the machine records while nothing is left out."""

FEW_FILES = 100
"""Of files that can still be made [1]: with fewer it is told. Larger: small disks are told of for
nothing. Smaller: less time is left. Arithmetic: an hour of the shortest logs there may be, a minute
each, with two more files for one while it is made smaller, and some flight records."""


def files_left(folder: Path) -> float:
    """Return how many files an ordinary user may still make on a folder's disk; inf: no limit."""
    stat = os.statvfs(folder)
    return float(stat.f_favail) if stat.f_files else math.inf


class FilesOutlook:
    """Follows how many files can still be made on a disk, and says when they are few."""

    def __init__(self) -> None:
        self.left: float = math.inf
        self._told_below = float(FEW_FILES)

    def look(self, left: float) -> bool:
        """Take how many are left; tell whether `warning` is news: again with half as many."""
        self.left = left
        if left >= FEW_FILES:
            self._told_below = float(FEW_FILES)
            return False
        if left >= self._told_below:
            return False
        self._told_below = left / 2
        return True

    @property
    def warning(self) -> str | None:
        """In words, where they are few; None: they are not."""
        if self.left >= FEW_FILES:
            return None
        return (
            f"only {self.left:.0f} more files can be made (warned below {FEW_FILES}), whatever "
            "space is free; where none can, no next log is begun and none made smaller: remove "
            "files from the disk of the logs (`df -i` tells)"
        )


@dataclass(frozen=True)
class Occupied:
    """What logs take of the disk, in megabytes."""

    free_mb: float
    logs_mb: float
    """All logs of the machine."""
    recorded_mb: float
    """Of these, what is recorded or waits to be made logs; it becomes smaller."""
    closed_share: float | None
    """What is left of a log when it is closed, as measured; None: not yet."""


@dataclass(frozen=True)
class Outlook:
    """How long recording can go on."""

    recorded_mb_h: float
    """At the present rate, while it is recorded."""
    closed_mb_h: float
    """And in closed logs."""
    hours_left: float | None
    """Until recording stops; None: not at this rate, or retention sees to it that it does not."""


class DiskOutlook:
    """Follows a recording's rate and foretells when the disk is full.

    Parameters
    ----------
    settings
        How logs rotate, and what retention keeps.
    expected
        The rate, as long as none is known.
    reserve_mb
        Below which free space recording stops [MB].
    """

    def __init__(self, settings: RecordingKeys, expected: RecordingRate, reserve_mb: float) -> None:
        self._settings = settings
        self._reserve_mb = reserve_mb
        self._expected = expected
        self._largest_mb = largest_log_mb(settings, expected) or 0.0
        self._seen: deque[tuple[float, int]] = deque()

    def look(self, time_s: float, bytes_written: int, occupied: Occupied) -> Outlook:
        """Return the outlook.

        Parameters
        ----------
        time_s
            The loop's time [s].
        bytes_written
            By the recording until then.
        occupied
            The disk as it is now.
        """
        recorded = self._rate_mb_h(time_s, bytes_written)
        share = occupied.closed_share or CLOSED_SHARE
        closed = recorded * share
        room = max(occupied.free_mb - self._reserve_mb, 0.0)
        if recorded <= 0.0 or self._is_kept_free(occupied.logs_mb, room, closed):
            return Outlook(recorded, closed, None)
        # What is recorded now becomes smaller, but the last log before the end is as large as any.
        smaller = (1.0 - share) * (occupied.recorded_mb - self._largest_mb)
        hours = max((room + smaller) / closed, room / recorded)
        return Outlook(recorded, closed, hours)

    def _rate_mb_h(self, time_s: float, bytes_written: int) -> float:
        seen = self._seen
        seen.append((time_s, bytes_written))
        while len(seen) > 2 and seen[1][0] <= time_s - WINDOW_S:
            seen.popleft()
        seconds = time_s - seen[0][0]
        if seconds < KNOWN_AFTER_S:
            return self._expected.recorded_mb_h
        return (bytes_written - seen[0][1]) / MEGABYTE * 3600.0 / seconds

    def _is_kept_free(self, logs_mb: float, room_mb: float, closed_mb_h: float) -> bool:
        """Tell whether retention removes logs before the disk is full."""
        kept = self._settings.retention
        if kept.min_free_mb is not None:
            return True
        if kept.max_total_size_mb is not None and kept.max_total_size_mb < logs_mb + room_mb:
            return True
        if kept.max_age_days is None:
            return False
        return closed_mb_h * kept.max_age_days * 24.0 + self._largest_mb < logs_mb + room_mb
