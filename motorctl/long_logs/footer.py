"""What the footer of a log tells of its row groups before a row is read: times, and motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.columns import POSITION
from motorctl.log.parquet_pieces import ParquetPieces


def times_of(source: str, pieces: ParquetPieces) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return first and last time [s] of each row group, (K,) each.

    Raises DataError where row groups do not follow each other, or the footer does not tell.
    """
    low, high = pieces.extremes("time_s")
    if not np.isfinite([*low, *high]).all():
        raise DataError(f"{source}: its footer does not tell the times of its row groups")
    back = np.flatnonzero(low[1:] <= high[:-1])
    if len(back):
        k = int(back[0])
        raise DataError(
            f"{source}: rows of more than one recording: row group {k + 2} begins at "
            f"{low[k + 1]:.6g} s, and the one before ends at {high[k]:.6g} s; give the recordings "
            "one by one"
        )
    return low, high


def tells_times(pieces: ParquetPieces) -> bool:
    """Return whether the times of all row groups stand in the footer."""
    return bool(np.isfinite(pieces.extremes("time_s")).all())


def moved_in(pieces: ParquetPieces, axis: str) -> tuple[bool, ...]:
    """Return in which row groups the position of an axis changed, or may have."""
    low, high = pieces.extremes(axis + POSITION)
    return tuple(bool(moved) for moved in ~(low == high))


def furthest_in(pieces: ParquetPieces, axis: str, least_rows: int) -> int | None:
    """Return in which row group, of so many rows at least, an axis went furthest.

    None where the footer does not tell.
    """
    low, high = pieces.extremes(axis + POSITION)
    rows = np.diff([*pieces.begins, pieces.rows])
    went = np.where((rows >= least_rows) & np.isfinite(high - low), high - low, -np.inf)
    k = int(np.argmax(went))
    return k if went[k] > 0.0 else None
