"""Whether times that are not uniform are those of uneven samples, or of a clock read late."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

Array = NDArray[np.float64]
Ticks = NDArray[np.int64]

HOLE_STEPS = 5.0
"""A step longer than so many of those that nine tenths of the samples keep is a hole."""
SMOOTHER = 0.7
"""Where the motion is so much smoother over the count of its samples than over their times, or the
other way round, it tells which of the two is right."""
MOSTLY = 0.95
"""Where it does not tell, samples count as uniform if this part of the steps is one period."""
ONE_PERIOD = 0.25
"""How far a step may be from one period to count as one."""
LATE_SAMPLES = 7
"""Samples whose median tells a hole from a clock that was read late: at most three in a row are."""
FURTHEST_PERIODS = 1.5
"""A clock that is read late lies at most so far off the uniform grid, drift apart."""


def longest_step(time_s: Array) -> float:
    """Return the longest step that is no hole [s]."""
    return HOLE_STEPS * float(np.percentile(np.diff(time_s), 90.0))


def usual_step(time_s: Array) -> float:
    """Return the mean time between neighbouring samples, holes apart [s]."""
    steps = np.diff(time_s)
    median = float(np.median(steps))
    near = np.abs(steps / median - 1.0) < ONE_PERIOD
    if np.mean(near) > MOSTLY:
        return float(np.mean(steps[near]))
    return float(np.mean(steps[steps <= longest_step(time_s)]))


def counted_ticks(time_s: Array, period_s: float) -> Ticks:
    """Return which usual period each sample belongs to, from 0: no two share one.

    A clock that is read late is late for a sample or two; behind a hole all are.
    """
    count = np.arange(len(time_s))
    beyond = median_filter((time_s - time_s[0]) / period_s - count, LATE_SAMPLES)
    holes = np.rint(beyond - beyond[0]).astype(np.int64)
    return np.asarray(np.maximum.accumulate(holes) + count)


def is_even_by_index(ticks: Ticks, time_s: Array, period_s: float, motion: Sequence[Array]) -> bool:
    """Return whether motion is clearly smoother over the count of its samples than over its times.

    Parameters
    ----------
    ticks
        The count of periods, with what is missing, (N,).
    time_s
        The recorded times [s], (N,).
    period_s
        The usual time between neighbouring samples [s].
    motion
        Smooth columns, (N,) each, such as positions.

    Returns
    -------
    bool
        True where the times are those of a clock read late, and samples are uniform.
    """
    count = ticks.astype(np.float64)
    drift = np.polynomial.Polynomial.fit(count, time_s, 1)
    slope = float(drift.deriv()(0.0))
    if slope <= 0.0 or float(np.max(np.abs(time_s - drift(count)))) > FURTHEST_PERIODS * slope:
        return False
    even = sum(_roughness(count, values) for values in motion)
    uneven = sum(_roughness(time_s, values) for values in motion)
    if even < SMOOTHER * uneven or uneven < SMOOTHER * even:
        return even < uneven
    steps = np.diff(time_s) / period_s
    return float(np.mean(np.abs(steps - np.rint(steps)) < ONE_PERIOD)) > MOSTLY


def _roughness(places: Array, values: Array) -> float:
    """Return what a cubic through two samples on each side misses, over the range of the values."""
    finite = np.isfinite(values)
    x, y = places[finite], values[finite]
    if len(x) < 8 or np.ptp(y) == 0.0:
        return 0.0
    nodes = [x[k : len(x) - 4 + k] for k in (0, 1, 3, 4)]
    at = x[2:-2]
    predicted = np.zeros_like(at)
    for i, k in enumerate((0, 1, 3, 4)):
        weight = np.ones_like(at)
        for j, node in enumerate(nodes):
            if j != i:
                weight *= (at - node) / (nodes[i] - node)
        predicted += weight * y[k : len(y) - 4 + k]
    return float(np.sqrt(np.mean((y[2:-2] - predicted) ** 2)) / np.ptp(y))
