"""Times of day and dates in the cells of a text file, as seconds."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, time

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DAY_S = 86_400.0


def is_time(cell: str) -> bool:
    """Return whether a cell is a date with a time, or a time of day, as ISO 8601 writes them."""
    return _moment(cell) is not None


def seconds_since_first(cells: Sequence[str | None]) -> tuple[Array, int | None]:
    """Return seconds from the first time of a column; a time of day goes on past midnight.

    Parameters
    ----------
    cells
        As the file has them; None or blanks where there is nothing.

    Returns
    -------
    seconds : ndarray
        (N,); NaN where there is nothing.
    wrong : int or None
        The first cell, from 0, that is no time of the first one's kind.
    """
    seconds = np.full(len(cells), np.nan)
    first: datetime | time | None = None
    before = days = 0.0
    for k, cell in enumerate(cells):
        if cell is None or not cell.strip():
            continue
        moment = _moment(cell)
        first = first or moment
        try:
            now = _between(first, moment)
        except TypeError:
            return seconds, k
        if isinstance(moment, time) and now + days < before - 0.5 * _DAY_S:
            days += _DAY_S
        before = seconds[k] = now + days
    return seconds, None


def _between(first: datetime | time | None, moment: datetime | time | None) -> float:
    """Return seconds from one to the other; raise TypeError where they are not of one kind."""
    if isinstance(first, datetime) and isinstance(moment, datetime):
        return (moment - first).total_seconds()
    if isinstance(first, time) and isinstance(moment, time):
        return _of_day(moment) - _of_day(first)
    raise TypeError("a date and a time of day")


def _of_day(moment: time) -> float:
    return 3600.0 * moment.hour + 60.0 * moment.minute + moment.second + 1e-6 * moment.microsecond


def _moment(cell: str) -> datetime | time | None:
    text = cell.strip()
    if ":" not in text:
        return None  # a plain number may pass for a date
    for kind in (datetime, time):
        try:
            return kind.fromisoformat(text)
        except ValueError:
            continue
    return None
