"""Turn what a crash left of a recording into a log."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.errors import DataError
from motorctl.log.convert import convert, load_metadata
from motorctl.log.partial import SUFFIX, PartialFile

MOST_TORN_BYTES = 16 << 20
"""A write is one batch of at most 8192 rows; some of them may have been under way."""


@dataclass(frozen=True)
class Recovery:
    """What became of a partial file."""

    path: Path
    """The log."""
    rows: int
    tail_cut: bool
    """Something was torn and is given up."""
    was_finished: bool
    """The log was complete already; only the partial file was left over."""
    partial_kept: bool
    """More was damaged than an interrupted write can do, so the partial file is still there."""
    was_closed: bool = False
    """The recording itself was complete, and only waited to be made a log."""


def recover(path: Path, out: Path | None = None) -> Recovery:
    """Make a log of everything that is whole in a partial file, then remove the partial file.

    A partial file with more damage than a torn end stays, whatever could be taken from it.

    Parameters
    ----------
    path
        The partial file, or the log that it should have become.
    out
        Where the log shall be; None: beside the partial file.

    Returns
    -------
    Recovery
        The log, its rows, and what was given up.

    Raises
    ------
    DataError
        Where there is nothing to recover, where it is still being recorded, or where another
        recording already stands in the log's place.
    """
    partial = _partial_of(Path(path))
    target = Path(out or partial.with_name(partial.name.removesuffix(SUFFIX)))
    with _locked(partial):
        PartialFile(partial).close()  # tells first what is not a recording at all
        if target == partial:
            raise DataError(f"{partial}: the log would overwrite it; name another file with --out")
        finished = _rows_if_finished(partial, target)
        if finished is not None:
            rows, keep = finished
            if not keep:
                partial.unlink()
            return Recovery(target, rows, tail_cut=False, was_finished=True, partial_kept=keep)
        try:
            done = convert(partial, target, {"recovered": True, "rows_lost": None})
        except OSError as error:
            raise DataError(f"{target}: cannot be written: {error.strerror or error}") from error
        keep = done.given_up_bytes > MOST_TORN_BYTES
        if not keep:
            partial.unlink()
        torn = done.given_up_bytes > 0
        return Recovery(
            target, done.rows, torn, was_finished=False, partial_kept=keep, was_closed=done.whole
        )


def _partial_of(path: Path) -> Path:
    if path.name.endswith(SUFFIX):
        partial = path
    else:
        beside = path.with_name(path.name + SUFFIX)
        partial = beside if beside.exists() else path
    if not partial.is_file():
        raise DataError(f"{path}: no such file")
    if partial == path and _log_head(path) is not None:
        raise DataError(f"{path}: is a finished log: there is nothing to recover")
    return partial


@contextmanager
def _locked(partial: Path) -> Iterator[None]:
    try:
        handle = os.open(partial, os.O_RDONLY)
    except OSError as error:
        raise DataError(f"{partial}: cannot be read: {error.strerror}") from error
    try:
        with suppress(OSError):  # some file systems know no locks
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise DataError(
                    f"{partial}: a daemon is recording to it, or making a log of it; wait until "
                    "that is done, or stop the daemon first"
                ) from error
        yield
    finally:
        os.close(handle)


def _rows_if_finished(partial: Path, target: Path) -> tuple[int, bool] | None:
    """Return the rows of a log that already holds this recording; else None.

    And whether the partial file is damaged beyond a torn end.
    """
    if not target.exists():
        return None
    source = PartialFile(partial)
    try:
        opening = load_metadata(source.schema)
        rows = sum(batch.num_rows for batch in source.batches())
    finally:
        source.close()
    head = _log_head(target)
    if head is not None:
        found, kept = head
        if kept >= rows and all(found.get(key) == value for key, value in opening.items()):
            return kept, source.given_up_bytes > MOST_TORN_BYTES
    raise DataError(f"{target}: another file is here; move it, or name another file with --out")


def _log_head(path: Path) -> tuple[dict[str, Any], int] | None:
    """Return metadata and number of rows of a complete Parquet file; None where it is not one."""
    try:
        with pq.ParquetFile(path) as log:
            return load_metadata(log.schema_arrow), log.metadata.num_rows
    except (pa.ArrowException, OSError, ValueError):
        return None
