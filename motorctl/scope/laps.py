"""A column over the time in a program's cycle: repeated laps, one over the other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.identify.columns.repetition import find_period
from motorctl.log.sample import AxisState
from motorctl.scope.planes import MOST_ROWS
from motorctl.scope.shown import Shown
from motorctl.scope.wire import Answer

Array = NDArray[np.float64]
PIXELS = 800
"""Across a lap: of each the least and the greatest value is told, so no peak is lost."""
MOST_LAPS = 40
"""That are drawn: the last ones of the view. More lie one over the other. By hand."""
LEAST_SHARE = 0.5
"""Of a lap, below which one that the view cuts is left out."""


def laps(shown: Shown, axis: str, name: str, begin_s: float, end_s: float) -> Answer:
    """Return the laps of an axis' column, from where its reference begins to repeat.

    Parameters
    ----------
    shown
        The log.
    axis, name
        The axis, and the column.
    begin_s, end_s
        From when to when [s] by the log's own clock. The period is looked for in this stretch.

    Returns
    -------
    Answer
        `x`, the time in the cycle [s], and `y`, lap after lap; `rows` of each lap. What is told
        has `period_s` and `first`, the number of the first lap, and `note` where nothing repeats.
    """
    reference = f"{axis}.reference_m"
    for each in (reference, name):
        if each not in shown.log.columns:
            raise UsageError(f"no column '{each}' in {shown.name}")
    first, last = shown.rows_between(begin_s, end_s)
    told: dict[str, Any] = {}
    if last - first > MOST_ROWS:
        first = last - MOST_ROWS
        told["note"] = f"the last {MOST_ROWS / shown.rate_hz():.4g} s of this view"
    first = _where_it_runs(shown, axis, first, last)
    time_s = shown.pyramid.rows("time_s", first, last).astype(float)
    led = shown.pyramid.rows(reference, first, last).astype(float)
    known = np.isfinite(led)
    period_s = None
    if known.sum() > PIXELS and np.ptp(led[known]) > 0.0:
        period_s = find_period(time_s[known], led[known])
    if period_s is None:
        told["note"] = "no cycle is repeated in this view: zoom out"
        empty = np.empty(0)
        return Answer(told, {"x": empty, "y": empty, "rows": empty})
    values = shown.pyramid.rows(name, first, last).astype(float)
    number = np.floor((time_s - time_s[0]) / period_s).astype(np.int64)
    whole = int(number[-1]) + 1
    drawn = [
        lap
        for k in range(max(0, whole - MOST_LAPS), whole)
        if (lap := _lap(time_s, values, number == k, time_s[0] + k * period_s, period_s))
    ]
    told |= {"period_s": period_s, "first": max(0, whole - MOST_LAPS) + 1}
    return Answer(
        told,
        {
            "x": np.concatenate([x for x, _ in drawn]),
            "y": np.concatenate([y for _, y in drawn]),
            "rows": np.array([len(x) for x, _ in drawn], float),
        },
    )


def _where_it_runs(shown: Shown, axis: str, first: int, last: int) -> int:
    """Return the first row in which the axis runs; the first of all where none tells so."""
    name = f"{axis}.state"
    if name not in shown.log.columns:
        return first
    running = np.flatnonzero(shown.pyramid.rows(name, first, last) == AxisState.RUNNING)
    return first + int(running[0]) if len(running) else first


def _lap(
    time_s: Array, values: Array, own: NDArray[np.bool_], begins_s: float, period_s: float
) -> tuple[Array, Array] | None:
    """Return a lap with the least and greatest value of each pixel; None of too little of it."""
    x, y = time_s[own] - begins_s, values[own]
    there = np.isfinite(y)
    x, y = x[there], y[there]
    if not len(x) or x[-1] - x[0] < LEAST_SHARE * period_s:
        return None
    starts = np.flatnonzero(np.diff((x * PIXELS / period_s).astype(np.int64), prepend=-1))
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    both = np.column_stack((low, high))
    falls = np.gradient(low + high) < 0 if len(low) > 1 else np.zeros(len(low), bool)
    both[falls] = both[falls, ::-1]
    return np.repeat(x[starts], 2), both.ravel()
