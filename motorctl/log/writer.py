"""Write a log while it is being recorded."""

from __future__ import annotations

import fcntl
import json
import os
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.log.columns import LogAxis, log_columns, log_schema
from motorctl.log.convert import convert
from motorctl.log.partial import SUFFIX, Ending, encode_batch, encode_ending, encode_head
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.log.synced import sync
from motorctl.version import VERSION

BATCH_ROWS = 8192


class LogWriter:
    """A log that is being recorded: ``<path>.partial`` until `close` makes it ``<path>``.

    `seal` ends it, too, and leaves making the log to `motorctl.log.recover`, at any time.

    `metadata` joins version, host, start time, axes and the names of states, faults and flags,
    and may replace them. Raises UsageError where the file cannot be made.
    """

    def __init__(self, path: Path, metadata: Mapping[str, Any], axes: Sequence[LogAxis]) -> None:
        self.path = Path(path)
        self.partial = self.path.with_name(self.path.name + SUFFIX)
        self.rows_lost = 0
        self.rows = 0
        """Those that were written."""
        self._columns = log_columns(axes)
        self._schema = log_schema(axes, json.dumps(_opening(axes) | dict(metadata)).encode())
        self._stage = [np.empty(BATCH_ROWS, column.dtype) for column in self._columns]
        self._staged = 0
        self._file = self._create()
        self._whole_bytes = 0
        self._torn = False
        try:
            self._write(encode_head(self._schema))
            self._sync_folder()
        except (OSError, RunError) as error:
            os.close(self._file)
            self.partial.unlink()
            raise UsageError(f"{self.path}: the recording cannot be opened: {error}") from error

    def append(self, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        """Take copies of rows.

        Parameters
        ----------
        ticks
            Of TICK_SAMPLE, shape (N,).
        samples
            Of axis_sample, shape (N, axes).

        Raises
        ------
        RunError
            Where the disk refuses them; the rows are then lost and counted.
        """
        done = 0
        while done < len(ticks):
            count = min(len(ticks) - done, BATCH_ROWS - self._staged)
            self._copy(ticks[done : done + count], samples[done : done + count])
            self._staged += count
            done += count
            if self._staged == BATCH_ROWS:
                self._write_batch()

    def flush(self) -> None:
        """Bring every row that was appended onto the disk. Raises RunError where it fails."""
        self._write_batch()
        self._sync()

    @property
    def rows_taken(self) -> int:
        """Those that were appended and not lost, written or not."""
        return self.rows + self._staged

    @property
    def size_bytes(self) -> int:
        """Size of the partial file."""
        return self._whole_bytes

    @property
    def misplaced(self) -> bool:
        """Whether the partial file was removed or moved by somebody since it was made."""
        try:
            there = self.partial.stat()
        except FileNotFoundError:
            return True
        except OSError:  # its disk does not answer: rows will be refused, which tells more
            return False
        return not os.path.samestat(there, os.fstat(self._file))

    def abandon(self) -> bool:
        """Leave a misplaced file alone; tell whether it still is somewhere."""
        try:
            return os.fstat(self._file).st_nlink > 0
        finally:
            os.close(self._file)

    def seal(self, extra: Mapping[str, Any] | None = None) -> Path:
        """End the recording and return the partial file, which says so; `extra` joins the metadata.

        Raises RunError where the disk refuses that; what was recorded stays.
        """
        try:
            self.flush()
            self._end({"rows_lost": self.rows_lost, **(extra or {})})
        finally:
            os.close(self._file)
        return self.partial

    def discard(self) -> None:
        """Give up a recording that nothing was written to."""
        self.partial.unlink(missing_ok=True)
        os.close(self._file)

    def close(self, extra: Mapping[str, Any] | None = None) -> Path:
        """Finish the log and return its path; `extra` joins the metadata.

        Raises RunError where that fails; the partial file then stays, for `motorctl log recover`.
        """
        try:
            self.flush()
            closing = {"rows_lost": self.rows_lost, **(extra or {})}
            with suppress(RunError):  # it is there for who is killed while the log is made
                self._end(closing)
            readable = convert(self.partial, self.path, closing).rows
            if readable == self.rows:
                self.partial.unlink()
                return self.path
            cause = f"of {self.rows} rows only {readable} can be read back"
        except (OSError, MotorctlError) as error:
            cause = str(error)
        finally:
            os.close(self._file)
        hint = f"what can be read is in {self.partial}; to keep it: motorctl log recover"
        raise RunError(f"{self.path}: cannot be finished: {cause}; {hint}")

    def _copy(self, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        rows = slice(self._staged, self._staged + len(ticks))
        for stage, column in zip(self._stage, self._columns, strict=True):
            if column.axis is None:
                stage[rows] = ticks[column.field.name]
            elif column.entry is None:
                stage[rows] = samples[column.field.name][:, column.axis]
            else:
                stage[rows] = samples[column.field.name][:, column.axis, column.entry]

    def _end(self, closing: Mapping[str, Any]) -> None:
        self._write(encode_ending(self._schema, Ending(self.rows, closing)))
        self._sync()

    def _write_batch(self) -> None:
        count, self._staged = self._staged, 0
        if count == 0:
            return
        try:
            self._write(encode_batch(self._schema, [stage[:count] for stage in self._stage]))
        except BaseException:
            self.rows_lost += count
            raise
        self.rows += count

    def _write(self, data: bytes | memoryview) -> None:
        """Write all of it, or leave the file as it was: what follows stays readable."""
        left = memoryview(data)
        try:
            self._cut()
            while left:
                left = left[os.write(self._file, left) :]
        except BaseException as error:
            self._torn = True
            with suppress(OSError):  # a dead file refuses that, too: before the next write, then
                self._cut()
            if isinstance(error, OSError):
                message = f"{self.partial}: cannot be written: {error.strerror}"
                raise RunError(message) from error
            raise
        self._whole_bytes += len(data)

    def _cut(self) -> None:
        """Take away what a write that failed left behind."""
        if self._torn:
            os.ftruncate(self._file, self._whole_bytes)
            self._torn = False

    def _sync(self) -> None:
        try:
            os.fdatasync(self._file)
        except OSError as error:
            raise RunError(f"{self.partial}: cannot be written: {error.strerror}") from error

    def _create(self) -> int:
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.partial, flags, 0o644)
        except OSError as error:
            if isinstance(error, FileExistsError) and self.partial.exists():
                hint = f"motorctl log recover {self.partial}, or remove it"
                message = f"{self.partial}: an unfinished recording is here: {hint}"
                raise UsageError(message) from error
            raise UsageError(
                f"{self.path}: the recording cannot be opened: {error.strerror}"
            ) from error
        with suppress(OSError):  # some file systems know no locks
            fcntl.flock(handle, fcntl.LOCK_EX)  # `recover` keeps away from what is being recorded
        return handle

    def _sync_folder(self) -> None:
        os.fdatasync(self._file)
        sync(self.path.parent)


def _opening(axes: Sequence[LogAxis]) -> dict[str, Any]:
    return {
        "version": VERSION,
        "host": {"name": platform.node()},
        "started_utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "axes": {axis.name: {"parameters": list(axis.theta_names)} for axis in axes},
        "states": {state.value: state.name for state in AxisState},
        "faults": {fault.value: fault.name for fault in FaultCause},
        "flags": {flag.value: flag.name for flag in SampleFlag},
    }
