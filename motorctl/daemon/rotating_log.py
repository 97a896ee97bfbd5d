"""The log of a run as a row of files: each an ordinary log, no row in two of them or in none."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.recording_keys import RecordingKeys
from motorctl.config.recording_rules import MEGABYTE
from motorctl.daemon.pauses import PausesWhileOff
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.log import LogAxis, LogWriter
from motorctl.log.columns import log_columns
from motorctl.log.folder import free_log_path, time_in_name

BATCH_BYTES = 16_000
"""What a batch takes beside its rows, at most: descriptions of its columns, padding."""
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors after which a log is closed: rows go on in the next one once there is room."""
CLOCK_BACK_S = 2.0
"""A clock that was set back by more than this is told; names have whole seconds."""
RESUME_MARGIN = 1.1
"""So many times the space at which recording stops must be free again: else it would flutter."""

_log = logging.getLogger("motorctl")


def free_bytes(folder: Path) -> float:
    """Return how much an ordinary user may still write to the disk of a folder."""
    stat = os.statvfs(folder)
    return float(stat.f_bavail * stat.f_frsize)


def reserve_bytes(settings: RecordingKeys, folder: Path) -> float:
    """Return below which free space of a folder's disk recording stops; 0 if it tells no size."""
    try:
        stat = os.statvfs(folder)
    except OSError:
        return 0.0
    return settings.reserve_mb(stat.f_blocks * stat.f_frsize / MEGABYTE) * MEGABYTE


class RotatingLog:
    """Writes rows as `LogWriter` does, and begins a new log where the settings say so.

    Parameters
    ----------
    directory
        Of the logs.
    machine
        Its name, with which the logs' names begin.
    axes
        Of the logs.
    opening
        Asked for the metadata with which each log begins.
    closing
        Asked for what joins them at its end; `rows_lost` in it counts those of the whole run.
    settings
        When a log is full, what is recorded while axes are off, and when the disk is.
    on_sealed
        Called with the partial file of each log that is complete but for being made a log.
    free
        Asked for the free space of the disk, in bytes.
    now
        Asked for the time that stands in a log's name.

    Raises
    ------
    UsageError
        Where the first log cannot be opened, for another reason than a full disk.
    """

    def __init__(
        self,
        directory: Path,
        machine: str,
        axes: Sequence[LogAxis],
        opening: Callable[[], Mapping[str, Any]],
        closing: Callable[[], Mapping[str, Any]],
        settings: RecordingKeys,
        on_sealed: Callable[[Path], None],
        free: Callable[[Path], float] = free_bytes,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.part = 0
        """Number of the log within the run, from 1."""
        self.rows = 0
        """Those that were written, to all logs of the run."""
        self.rows_lost = 0
        self.bytes_written = 0
        """By the rows of the run, as they are recorded."""
        self.time_s = 0.0
        """The loop's time of the last row that came, written or not."""
        self.trouble: str | None = None
        """Why the last log could not be ended, or the next not begun; no row was lost by that."""
        self._directory = directory
        self._machine = machine
        self._axes = tuple(axes)
        self._row_bytes = sum(column.dtype.itemsize for column in log_columns(axes))
        self._opening = opening
        self._closing = closing
        rotate = settings.rotate
        self._max_bytes = (rotate.max_size_mb or np.inf) * MEGABYTE
        self._max_s = (rotate.max_duration_h or np.inf) * 3600.0
        self._stop_below = reserve_bytes(settings, directory)
        self._pauses = PausesWhileOff() if settings.while_off == "pause" else None
        self._on_sealed = on_sealed
        self._free = free
        self._now = now
        self._clock_told = False
        self._lost_before = 0
        self._begin_s: float | None = None
        self._full = False
        self._last: Path | None = None
        """The last log that was ended."""
        self._other_models_before: str | None = None
        """The last log of other models, which the first one of these names."""
        self._run = ""
        self._writer: LogWriter | None = None
        self._path = self._next_path()
        try:
            self._writer = self._open(None)
            self._path = self._writer.path
        except UsageError as error:
            if not _is_full(error):
                raise
            # A machine may run with a full disk: the first rows that come try again, and tell.

    @property
    def path(self) -> Path:
        """Where the log that is being recorded will stand; while the disk is full, the last one."""
        return self._path

    @property
    def run(self) -> str:
        """What the run is called: as its first log, without the suffix."""
        return self._run

    @property
    def paused(self) -> bool:
        """Whether rows are left out, as every axis is off."""
        return self._pauses is not None and self._pauses.paused

    def append(self, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        """Bring rows onto the disk.

        Parameters
        ----------
        ticks
            Of TICK_SAMPLE, shape (N,).
        samples
            Of axis_sample, shape (N, axes).

        Raises
        ------
        RunError
            Where the disk refuses rows; they are lost and counted, and the next ones are tried.
        """
        if not len(ticks):
            return
        self.time_s = float(ticks["time_s"][-1])
        if self._pauses is not None:
            kept = self._pauses.rows_to_record(ticks, samples)
            ticks, samples = ticks[kept], samples[kept]
        before, done = self.rows, 0
        try:
            while done < len(ticks):
                count = self._rows_that_fit(ticks["time_s"][done:])
                if count == 0 and self._rotated():
                    continue
                count = count or len(ticks) - done  # there is no next log: on in this one
                self._write(ticks[done : done + count], samples[done : done + count])
                done += count
        finally:
            self.rows_lost += len(ticks) - (self.rows - before)
        if self._begin_s is not None and self.time_s - self._begin_s >= self._max_s:
            self._rotated()  # though no row comes, as in a pause

    def change_models(
        self, axes: Sequence[LogAxis], opening: Callable[[], Mapping[str, Any]]
    ) -> None:
        """End the run of logs, and begin another: rows of other models have other columns.

        Parameters
        ----------
        axes
            Of the logs from here on.
        opening
            Asked for the metadata with which each of them begins.
        """
        ended, self._writer = self._writer, None
        if ended is not None and ended.rows == 0:
            ended.discard()
        elif ended is not None:
            self._seal(ended, None)
        if self._last is not None:
            self._other_models_before = self._last.name
        self._axes, self._opening = tuple(axes), opening
        self._row_bytes = sum(column.dtype.itemsize for column in log_columns(axes))
        self.part, self._last, self._begin_s = 0, None, None
        try:
            self._writer = self._open(None)
        except (MotorctlError, OSError) as error:
            self.trouble = f"the log of the new models cannot be begun: {error}"  # tried again
        else:
            self._path, self.trouble = self._writer.path, None

    def flush(self) -> None:
        """Do nothing: `append` brings every row onto the disk."""

    def close(self, extra: Mapping[str, Any]) -> Path:
        """Finish the last log and return its path; `extra` stands for what `closing` gives.

        Raises RunError where that fails; the partial file then stays, for `motorctl log recover`.
        """
        writer, self._writer = self._writer, None
        if writer is None:
            return self._path
        return writer.close(self._ending(extra, None))

    def _open(self, predecessor: Path | None) -> LogWriter:
        path = self._next_path()
        run = self._run if predecessor else path.stem
        part = {
            "run": run,
            "part": self.part + 1,
            "predecessor": predecessor.name if predecessor else None,
            "other_models_before": None if predecessor else self._other_models_before,
        }
        writer = LogWriter(path, {**self._opening(), **part}, self._axes)
        self._run = run
        self.part += 1
        return writer

    def _next_path(self) -> Path:
        """Return where the next log will stand; a clock that was set back is told once."""
        now = self._now()
        path = free_log_path(self._directory, self._machine, now)
        back_s = (time_in_name(path) - now).total_seconds()
        if back_s > CLOCK_BACK_S and not self._clock_told:
            _log.warning(
                "the computer's clock is %s before the newest log: the next ones take its time and "
                "a number, so that they stay in order; if its time is wrong, move it away",
                _duration(back_s),
            )
        self._clock_told = back_s > CLOCK_BACK_S
        return path

    def _rows_that_fit(self, times_s: NDArray[np.float64]) -> int:
        """Return how many of these rows still belong into the log that is being recorded."""
        writer = self._writer
        if writer is None:
            return len(times_s)
        begin_s = float(times_s[0]) if self._begin_s is None else self._begin_s
        by_time = int(np.searchsorted(times_s, begin_s + self._max_s, side="left"))
        room = self._max_bytes - writer.size_bytes - BATCH_BYTES
        by_size = len(times_s) if room == np.inf else max(int(room // self._row_bytes), 0)
        return max(min(len(times_s), by_time, by_size), 0 if writer.rows else 1)

    def _rotated(self) -> bool:
        """Begin the next log, then end this one, which names it; False where that cannot be."""
        try:
            following = self._open(self._path)
        except (MotorctlError, OSError) as error:
            self.trouble = f"the next log cannot be begun, so this one goes on: {error}"
            return False
        ended, self._writer = self._writer, following
        self._path, self._begin_s, self.trouble = following.path, None, None
        if ended is not None:
            self._seal(ended, following.path.name)
        return True

    def _write(self, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        """Write rows; where this log can take no more of them, the rest into a new one."""
        if self._writer is not None and self._writer.misplaced:
            self._leave_misplaced(self._writer)
        self._require_room(len(ticks) * self._row_bytes + BATCH_BYTES)
        first, refused = self.rows, None
        for _ in range(2):
            if self._writer is None:
                self._writer = self._open(self._last)
                self._path = self._writer.path
            done = self.rows - first
            try:
                self._put(self._writer, ticks[done:], samples[done:])
            except RunError as error:
                refused = error
                if _is_full(error):
                    self._end_for_want_of_space()
                    continue
                trouble = self.trouble
                if not (_is_of_the_disk(error) and self._rotated()):
                    self.trouble = trouble  # the refusal is what is told
                    raise
            else:
                return
        assert refused is not None
        raise refused

    def _leave_misplaced(self, writer: LogWriter) -> None:
        """Give up a file that is no longer where it was; the next rows begin a new one."""
        self._writer, self._last, self._begin_s = None, writer.path, None
        if writer.abandon():
            told = f"was moved while it was recorded; what it holds: {writer.rows} rows"
        else:
            told = f"was removed while it was recorded, and its {writer.rows} rows with it"
            self.rows -= writer.rows
        _log.error("recording: %s %s; a new log is begun", writer.partial, told)

    def _put(self, writer: LogWriter, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        size, rows = writer.size_bytes, writer.rows
        try:
            writer.append(ticks, samples)
            writer.flush()
        finally:
            written = writer.rows - rows
            self.rows += written
            self.bytes_written += writer.size_bytes - size
            if written and self._begin_s is None:
                self._begin_s = float(ticks["time_s"][0])

    def _require_room(self, size: float) -> None:
        """End the log where the disk is nearly full; raises RunError until there is room again."""
        free, limit = self._free(self._directory), self._stop_below
        if self._full and limit:
            limit = RESUME_MARGIN * limit
        if free >= limit + size:
            self._full = False
            return
        self._full = True
        self._end_for_want_of_space()
        raise RunError(
            f"{self._directory}: {free / MEGABYTE:.0f} MB are free, recording needs "
            f"{limit / MEGABYTE:.0f} (recording.disk.stop_below_mb): it stopped, and goes on in a "
            "new log once there is room"
        )

    def _end_for_want_of_space(self) -> None:
        writer, self._writer, self._begin_s = self._writer, None, None
        if writer is None:
            return
        if writer.rows == 0:
            writer.discard()
            self.part -= 1
            self._path = self._last or self._path
        else:
            self._seal(writer, None)

    def _seal(self, writer: LogWriter, successor: str | None) -> None:
        try:
            writer.seal(self._ending(self._closing(), successor))
        except (MotorctlError, OSError) as error:
            self.trouble = f"a log could not be told its end, which its rows do not need: {error}"
        self._last = writer.path
        self._on_sealed(writer.partial)

    def _ending(self, facts: Mapping[str, Any], successor: str | None) -> dict[str, Any]:
        """Return the metadata with which a log ends: what was lost is counted log by log."""
        told: dict[str, Any] = {**facts, "successor": successor}
        if (lost := facts.get("rows_lost")) is not None:
            told["rows_lost"], self._lost_before = lost - self._lost_before, lost
        if self._pauses is not None:
            told |= self._pauses.take()
        return told


def _duration(seconds: float) -> str:
    return f"{seconds / 3600:.1f} h" if seconds >= 3600 else f"{seconds:.0f} s"


def _is_full(error: BaseException) -> bool:
    cause = _cause(error)
    return isinstance(cause, OSError) and cause.errno in FULL


def _is_of_the_disk(error: BaseException) -> bool:
    return isinstance(_cause(error), OSError)


def _cause(error: BaseException) -> BaseException | None:
    cause: BaseException | None = error
    while isinstance(cause, MotorctlError):
        cause = cause.__cause__
    return cause
