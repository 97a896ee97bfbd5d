"""Which waves over position a stretch of a column is made of: magnets, screws, scales."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.scope.planes import MOST_ROWS
from motorctl.scope.shown import Shown
from motorctl.scope.wire import Answer

Array = NDArray[np.float64]
MOST_CELLS = 1 << 14
"""Of the way, at most: more lines than any picture has pixels. By hand."""
LEAST_CELLS = 32
STEPS_A_CELL = 2.0
"""A cell is as long as so many rows go at the highest speed, so that each pass leaves rows in it.
Longer cells tell fewer waves, shorter ones stay empty. By hand."""
LEAST_SPEED = 0.02
"""Of the highest, below which the axis stands or turns round: a place is not passed there."""
SMOOTHED_S = 0.01
"""Over which speeds are taken, as counts of an encoder step. By hand."""


def place_spectrum(shown: Shown, name: str, position: str, begin_s: float, end_s: float) -> Answer:
    """Return the amplitude spectrum of a column over position.

    At each place the rows of all passes in one direction are averaged, so what does not belong to
    the place averages out; of both directions the mean power is taken, with Hann's window.

    Parameters
    ----------
    shown
        The log.
    name, position
        The column, and the positions that it is seen over.
    begin_s, end_s
        From when to when [s] by the log's own clock.

    Returns
    -------
    Answer
        `cycles` by metre, or by turn where positions are angles, and `amplitude`: of a sine at
        this wave number, its rms value. What is told has `unit`, and `note` where not all of the
        stretch was taken, or where it tells nothing.
    """
    for each in (name, position):
        if each not in shown.log.columns:
            raise UsageError(f"no column '{each}' in {shown.name}")
    turns = shown.log.units.get(position) == "rad"
    told: dict[str, Any] = {"unit": "cycles/turn" if turns else "cycles/m"}
    first, last = shown.rows_between(begin_s, end_s)
    if last - first > MOST_ROWS:
        last = first + MOST_ROWS
        told["note"] = f"the first {MOST_ROWS / shown.rate_hz():.4g} s of this view"
    x = shown.pyramid.rows(position, first, last).astype(float)
    values = shown.pyramid.rows(name, first, last).astype(float)
    there = np.isfinite(x) & np.isfinite(values)
    found = _both_ways(x[there], values[there], shown.rate_hz())
    if not found:
        told["note"] = "too little way is passed in this view: zoom out"
        return Answer(told, {"cycles": np.empty(0), "amplitude": np.empty(0)})
    length = min(len(each) for each, _ in found)
    power = np.mean([_power(each[:length]) for each, _ in found], axis=0)
    cell = found[0][1]
    cycles = np.arange(len(power)) / (length * cell)
    power /= np.sinc(cycles * cell) ** 2  # what the mean over a cell takes away
    scale = 2.0 * math.pi if turns else 1.0
    told["resolution"] = scale / (length * cell)
    return Answer(told, {"cycles": cycles * scale, "amplitude": np.sqrt(power)})


def _both_ways(x: Array, values: Array, rate_hz: float) -> list[tuple[Array, float]]:
    """Return the mean of each direction at each place, evenly along the way, and a cell's length.

    Places that are not passed end what is taken; the longest stretch of each direction counts.
    """
    if len(x) < LEAST_CELLS:
        return []
    rows = max(1, round(SMOOTHED_S * rate_hz))
    speed = np.gradient(np.convolve(np.pad(x, rows, "edge"), np.ones(rows) / rows, "same"))
    speed = speed[rows:-rows]
    fastest = float(np.quantile(np.abs(speed), 0.999))
    low, high = float(x.min()), float(x.max())
    if not (fastest > 0.0 and high > low):
        return []
    count = int(min(MOST_CELLS, (high - low) / (STEPS_A_CELL * fastest)))
    if count < LEAST_CELLS:
        return []
    cell = (high - low) / count
    place = np.minimum(((x - low) / cell).astype(np.int64), count - 1)
    found = []
    for way in (1.0, -1.0):
        passed = way * speed > LEAST_SPEED * fastest
        rows_in = np.bincount(place[passed], minlength=count)
        sums = np.bincount(place[passed], values[passed], minlength=count)
        begin, end = _longest(rows_in > 0)
        if end - begin >= LEAST_CELLS:
            found.append((sums[begin:end] / rows_in[begin:end], cell))
    return found


def _longest(there: NDArray[np.bool_]) -> tuple[int, int]:
    """Return begin and end of the longest stretch that is there."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], there.astype(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest])


def _power(values: Array) -> Array:
    """Return the squared rms of the sine that would make each line."""
    window = np.hanning(len(values) + 1)[:-1]
    lines = np.fft.rfft((values - values.mean()) * window) / window.sum()
    power: Array = np.abs(lines) ** 2
    power[1:] *= 2.0
    return power
