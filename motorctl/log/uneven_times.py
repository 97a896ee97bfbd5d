"""Whether times that are not uniform are those of uneven samples, or of a clock read late."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ticks = NDArray[np.int64]

RESAMPLED_STEPS = 3.0
"""A step longer than so many usual ones is a hole."""
SMOOTHER = 0.7
"""Samples are taken as uniform where that makes the motion so much smoother than its times do."""
FURTHEST_PERIODS = 1.5
"""A clock that is read late lies at most so far off the uniform grid, drift apart."""


def usual_step(time_s: Array) -> float:
    """Return the time between neighbouring samples, holes apart [s]."""
    steps = np.diff(time_s)
    median = float(np.median(steps))
    return float(np.mean(steps[steps <= RESAMPLED_STEPS * median]))


def is_even_by_index(ticks: Ticks, time_s: Array, motion: Sequence[Array]) -> bool:
    """Return whether motion is clearly smoother over the count of its samples than over its times.

    Parameters
    ----------
    ticks
        The count of periods, with what is missing, (N,).
    time_s
        The recorded times [s], (N,).
    motion
        Smooth columns, (N,) each, such as positions.

    Returns
    -------
    bool
        True where the times are those of a clock read late, and samples are uniform.
    """
    count = ticks.astype(np.float64)
    drift = np.polynomial.Polynomial.fit(count, time_s, 1)
    period = float(drift.deriv()(0.0))
    if period <= 0.0 or float(np.max(np.abs(time_s - drift(count)))) > FURTHEST_PERIODS * period:
        return False
    even = sum(_roughness(count, values) for values in motion)
    uneven = sum(_roughness(time_s, values) for values in motion)
    return even < SMOOTHER * uneven


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
