"""Columns over time, as a panel draws them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.scope.shown import GAP_PERIODS, Shown
from motorctl.scope.wire import Answer

MOST_PIXELS = 8192
"""Across one panel. More is no screen, and costs memory."""
MOST_COLUMNS = 64


def signals(
    shown: Shown, names: Sequence[str], begin_s: float, end_s: float, pixels: int
) -> Answer:
    """Return columns over a stretch of time.

    Of more than two rows a pixel the least and the greatest value of each pixel, one after the
    other; else every row. Where rows are missing the line is interrupted.

    Parameters
    ----------
    shown
        The log.
    names
        Its columns; those that it does not have are left out.
    begin_s, end_s
        From when to when [s] by the log's own clock.
    pixels
        How wide the panel is.

    Returns
    -------
    Answer
        `time_s` and the columns, and whether to ask again for more.
    """
    if not 1 <= pixels <= MOST_PIXELS:
        raise UsageError(f"pixels: {pixels}, which is not between 1 and {MOST_PIXELS}")
    if len(names) > MOST_COLUMNS:
        raise UsageError(f"columns: {len(names)} at once, more than {MOST_COLUMNS}")
    there = ["time_s", *(name for name in dict.fromkeys(names) if name in shown.log.columns)]
    first, last = shown.rows_between(begin_s, end_s)
    if last <= first:
        return Answer({"every_row": True, "coarse": False}, {name: np.empty(0) for name in there})
    found = shown.pyramid.envelope(there, first, last, pixels)
    period_s = 1.0 / shown.rate_hz()
    begins, ends = found.low["time_s"], found.high["time_s"]
    gaps = np.flatnonzero(begins[1:] - ends[:-1] > GAP_PERIODS * period_s) + 1
    if found.every_row:
        arrays = {name: found.low[name] for name in there}
    else:
        gaps *= 2
        arrays = {name: _interleaved(found.low[name], found.high[name]) for name in there}
    if len(gaps):
        arrays = {
            name: np.insert(np.asarray(values, float), gaps, np.nan)
            for name, values in arrays.items()
        }
        holes = gaps + np.arange(len(gaps))
        arrays["time_s"][holes] = arrays["time_s"][holes - 1] + period_s
    return Answer({"every_row": found.every_row, "coarse": found.coarse}, arrays)


def _interleaved(low: NDArray[Any], high: NDArray[Any]) -> NDArray[np.float64]:
    """Return both of each pixel one after the other, the greatest first where the line falls."""
    both = np.column_stack((low, high)).astype(float)
    middle = both.mean(axis=1)
    if len(middle) > 1:
        falls = np.gradient(middle) < 0
        both[falls] = both[falls, ::-1]
    return both.ravel()
