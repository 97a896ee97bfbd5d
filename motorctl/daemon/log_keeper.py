"""Look after closed logs and the disk, in a thread of its own: convert, remove, warn."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from motorctl.config.machine import Machine
from motorctl.config.recording_rules import MEGABYTE
from motorctl.config.recording_summary import recording_rate_of
from motorctl.daemon.conversion import Conversion
from motorctl.daemon.disk_outlook import DiskOutlook, FilesOutlook, Occupied, Outlook, files_left
from motorctl.daemon.error_text import in_words
from motorctl.daemon.rotating_log import RotatingLog, free_bytes, reserve_bytes
from motorctl.daemon.spell import Spell
from motorctl.log.folder import Removed, Retention, remove_outdated, stored_logs

PERIOD_S = 1.0
TIDY_PERIOD_S = 60.0
"""How often old logs are looked for; where space is short, at every look."""
FREED_AFTER_S = 60.0
"""How long the disk has to show what was removed as free [s]. Shorter: more logs are removed than
had to go, as btrfs frees with its next commit, within 30 s. Longer: where a reader keeps the file,
or somebody else fills the disk, less is free for so long than was asked for. Twice those 30 s."""
FORETELL_PERIOD_S = 10.0
SECONDS_A_DAY = 86_400.0

_log = logging.getLogger("motorctl")


class FreedLater:
    """What is free once the disk has freed what was removed."""

    def __init__(self) -> None:
        self._expected_bytes = 0.0
        self._since_s = -math.inf

    def note(self, before_bytes: float, gone_bytes: float, after_bytes: float) -> None:
        """Note that something was removed, with the free space before and after."""
        expected = before_bytes + gone_bytes
        if expected - after_bytes > gone_bytes / 2:  # less is what was written meanwhile
            self._expected_bytes, self._since_s = expected, time.monotonic()

    def free(self, measured_bytes: float) -> float:
        """Return the free space to reckon with [bytes]."""
        waits = time.monotonic() - self._since_s < FREED_AFTER_S
        return max(measured_bytes, self._expected_bytes) if waits else measured_bytes


class LogKeeper:
    """Makes logs of closed recordings, removes old ones, and tells how long the disk will do.

    Parameters
    ----------
    machine
        Whose logs, and by which settings.
    directory
        Of the logs.
    free
        Asked for the free space of a folder's disk, in bytes.
    files
        Asked for how many files can still be made on it.
    """

    def __init__(
        self,
        machine: Machine,
        directory: Path,
        free: Callable[[Path], float] = free_bytes,
        files: Callable[[Path], float] = files_left,
    ) -> None:
        self.log: RotatingLog | None = None
        self.outlook: Outlook | None = None
        self.failure: str | None = None
        """Why logs could not be looked after, or None."""
        self.removed = 0
        self.removed_mb = 0.0
        self.last_removed: Removed | None = None
        self.conversion = Conversion()
        self._machine = machine
        self._directory = directory
        self._free = free
        self._ask_files, self._files = files, FilesOutlook()
        kept, disk = machine.recording.retention, machine.recording.disk
        self._retention = Retention(
            max_age_s=None if kept.max_age_days is None else kept.max_age_days * SECONDS_A_DAY,
            max_total_bytes=_bytes(kept.max_total_size_mb),
            min_free_bytes=_bytes(kept.min_free_mb),
        )
        self._warn_below_h = disk.warn_below_h
        self._warn_again_h = math.inf
        self._disk = DiskOutlook(
            machine.recording,
            recording_rate_of(machine),
            reserve_bytes(machine.recording, directory) / MEGABYTE,
        )
        self._failing, self._troubled = Spell(), Spell()
        self._tidied_at = self._foretold_at = -math.inf
        self._freed_later = FreedLater()
        self._free_mb = math.nan
        """As of the last look: who asks for the status never waits for a disk."""
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="log-keeper", daemon=True)

    def begin(self) -> None:
        """Tell of what earlier runs left, and make room; call before the recording begins."""
        try:
            left = self.conversion.add_leftovers(self._directory, self._machine.name)
            self._tidy()
        except OSError as error:
            self.failure = in_words(error)
            _log.error("logs: %s", self.failure)
            return
        if left:
            names = ", ".join(path.name for path in left[:3]) + (", …" if left[3:] else "")
            _log.warning(
                "logs: %d of earlier runs are unfinished and are made logs in the background: %s",
                len(left),
                names,
            )

    def start(self, log: RotatingLog, loop_cpus: frozenset[int]) -> None:
        """Look after the logs of a recording from now on, off the CPUs that the loop has."""
        self.log = log
        self.conversion.keep_off = loop_cpus
        self._thread.start()

    def take(self, partial: Path) -> None:
        """Take over a recording that was closed; for any thread."""
        self.conversion.add(partial)
        self._tidied_at = -math.inf

    def look(self) -> None:
        """Do what is to be done now; whatever fails is told, and tried again."""
        failure = None
        for do in (self.conversion.look, self._tidy_in_time, self._foretell):
            try:
                do()
            except Exception as error:  # the recording and the machine go on
                failure = in_words(error)
        self.failure = failure
        if self._failing.is_news(failure):
            if failure:
                _log.error("logs: %s", failure)
            else:
                _log.info("logs: what had failed can be done again")
        if self.log is not None:
            trouble = self.log.trouble
            if self._troubled.is_news(trouble):
                if trouble:
                    _log.error("recording: %s", trouble)
                else:
                    _log.info("recording: logs are begun and ended again, now %s", self.log.path)

    def finish(self) -> list[str]:
        """Make logs of all that is left; call when the last one is closed. Return what failed."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()
        wrong = self.conversion.finish()
        try:
            self._tidy()
        except OSError as error:
            wrong.append(in_words(error))
        return wrong

    @property
    def warning(self) -> str | None:
        """In words, where recording cannot go on for long; None: it can."""
        return "; ".join(filter(None, (self._space_warning, self._files.warning))) or None

    @property
    def _space_warning(self) -> str | None:
        outlook = self.outlook
        if outlook is None or outlook.hours_left is None:
            return None
        if outlook.hours_left >= self._warn_below_h:
            return None
        return (
            f"recording can go on for about {_hours(outlook.hours_left)}: {self._free_mb:,.0f} MB "
            f"are free, "
            f"{outlook.closed_mb_h:,.0f} MB an hour are kept (warned below "
            f"{self._warn_below_h:g} h); remove logs, or let recording.retention do it"
        )

    def status(self) -> dict[str, Any]:
        """Return what `status` tells of parts, disk, closed logs and those that were removed."""
        log, outlook, conversion = self.log, self.outlook, self.conversion
        current = conversion.current
        return {
            "run": log.run if log else None,
            "part": log.part if log else None,
            "paused": log.paused if log else False,
            "trouble": log.trouble if log else None,
            "conversion": {
                "file": current.name if current else None,
                "waiting": len(conversion.waiting),
                "failed": [path.name for path in conversion.failed],
                "failure": conversion.failure,
            },
            "disk": {
                "free_mb": _rounded(self._free_mb),
                "free_files": int(self._files.left) if math.isfinite(self._files.left) else None,
                "recorded_mb_h": _rounded(outlook.recorded_mb_h if outlook else None),
                "closed_mb_h": _rounded(outlook.closed_mb_h if outlook else None),
                "hours_left": _rounded(outlook.hours_left if outlook else None),
                "warning": self.warning,
            },
            "retention": {
                "removed": self.removed,
                "removed_mb": round(self.removed_mb, 1),
                "last_removed": self.last_removed.path.name if self.last_removed else None,
                "because": self.last_removed.reason if self.last_removed else None,
                "failure": self.failure,
            },
        }

    def _run(self) -> None:
        while not self._ending.wait(PERIOD_S):
            self.look()

    def _tidy_in_time(self) -> None:
        free, minimum = self._free(self._directory), self._retention.min_free_bytes
        self._free_mb = free / MEGABYTE
        short = minimum is not None and self._freed_later.free(free) < minimum
        if short or time.monotonic() - self._tidied_at >= TIDY_PERIOD_S:
            try:
                self._tidy()
            except Exception:
                self._tidied_at = -math.inf  # at every look, until it can be done
                raise

    def _tidy(self) -> None:
        self._tidied_at = time.monotonic()
        limited = self._retention.min_free_bytes is not None
        before = self._reckoned_free() if limited else 0.0
        gone_bytes = 0
        for gone in remove_outdated(
            self._directory,
            self._machine.name,
            self._retention,
            time.time(),
            self._reckoned_free,
        ):
            gone_bytes += gone.size_bytes
            self.removed += 1
            self.removed_mb += gone.size_bytes / MEGABYTE
            self.last_removed = gone
            size = gone.size_bytes / MEGABYTE
            _log.info("log %s (%.3g MB) removed: %s", gone.path, size, _why(gone, self._retention))
        if limited and gone_bytes:
            self._freed_later.note(before, gone_bytes, self._free(self._directory))

    def _reckoned_free(self) -> float:
        return self._freed_later.free(self._free(self._directory))

    def _foretell(self) -> None:
        log, conversion = self.log, self.conversion
        if log is None or time.monotonic() - self._foretold_at < FORETELL_PERIOD_S:
            return
        logs = stored_logs(self._directory, self._machine.name)
        recorded = sum(stored.size_bytes for stored in logs if stored.partial)
        known = conversion.recorded_bytes
        occupied = Occupied(
            free_mb=self._free_mb,
            logs_mb=sum(stored.size_bytes for stored in logs) / MEGABYTE,
            recorded_mb=recorded / MEGABYTE,
            closed_share=conversion.closed_bytes / known if known else None,
        )
        first = self.outlook is None
        self.outlook = self._disk.look(log.time_s, log.bytes_written, occupied)
        self._foretold_at = time.monotonic()
        hours = self.outlook.hours_left
        if first:
            lasts = "retention keeps it free" if hours is None else f"enough for {_hours(hours)}"
            kept = f"{self.outlook.closed_mb_h:,.0f} MB an hour are kept"
            _log.info("disk: %s MB are free, %s: %s", f"{self._free_mb:,.0f}", kept, lasts)
        if hours is None or hours >= self._warn_below_h:
            self._warn_again_h = math.inf
        elif hours < self._warn_again_h:
            self._warn_again_h = hours / 2  # again when only half of it is left
            _log.warning("disk: %s", self._space_warning)
        if self._files.look(self._ask_files(self._directory)):
            _log.warning("disk: %s", self._files.warning)


def _bytes(megabytes: float | None) -> float | None:
    return None if megabytes is None else megabytes * MEGABYTE


def _rounded(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else round(value, 1)


def _hours(hours: float) -> str:
    if hours < 1.0:
        return f"{hours * 60.0:.1f} min"
    return f"{hours:.1f} h" if hours < 48 else f"{hours / 24:.0f} days"


def _why(gone: Removed, kept: Retention) -> str:
    """Return in words, with the limit, what a log was removed for."""
    if gone.reason == "age":
        return f"older than {(kept.max_age_s or 0.0) / SECONDS_A_DAY:g} days"
    if gone.reason == "total size":
        return f"all logs took more than {(kept.max_total_bytes or 0.0) / MEGABYTE:,.0f} MB"
    return f"less than {(kept.min_free_bytes or 0.0) / MEGABYTE:,.0f} MB were free"
