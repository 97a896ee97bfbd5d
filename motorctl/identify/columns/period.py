"""Find the period of a motion in its reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

Array = NDArray[np.float64]

MOST_POINTS = 1 << 16
FEWEST_POINTS = 16
UNLIKE = 0.5
"""A lag at which the reference differs so much shows that it moves at all."""
ALIKE = 0.01
"""What the squared difference of two periods may be, relative to their own size."""


def repeats(time_s: Array, reference: Array, period_s: float) -> bool:
    """Tell whether the last period of a reference is like the one before.

    True also where the recording is too short to show that it is not.
    """
    r, step_s = _uniform(time_s, reference)
    lag = round(period_s / step_s)
    shown = min(len(r) - lag, lag)
    if lag < 1 or shown < FEWEST_POINTS:
        return True
    now, before = r[-shown:], r[len(r) - shown - lag : len(r) - lag]
    size = float(np.sum(now**2) + np.sum(before**2))
    return size == 0.0 or float(np.sum((now - before) ** 2)) <= ALIKE * size


def find_period(time_s: Array, reference: Array) -> float | None:
    """Find the shortest period that shows at least twice; None where nothing repeats.

    The squared difference d(lag) = |r(t) - r(t - lag)|^2 / (|r(t)|^2 + |r(t - lag)|^2) comes from
    the autocorrelation; the period is its first deep minimum beyond the lags at which the motion
    differs from itself.
    """
    r, step_s = _uniform(time_s, reference)
    n = len(r)
    power = np.concatenate(([0.0], np.cumsum(r**2)))
    if n < FEWEST_POINTS or power[-1] == 0.0:
        return None
    lags = np.arange(n // 2 + 1)
    product = correlate(r, r, method="fft")[n - 1 : n + len(lags) - 1]
    size = (power[n] - power[lags]) + power[n - lags]
    unlike = 1.0 - 2.0 * product / np.maximum(size, power[-1] * 1e-12)
    differs = np.flatnonzero(unlike > UNLIKE)
    if len(differs) == 0:
        return None
    beyond = unlike[differs[0] :]
    deep = np.flatnonzero(beyond < ALIKE)
    if len(deep) == 0:
        return None
    first = int(deep[0])
    rises = np.flatnonzero(beyond[first:] >= ALIKE)
    end = first + (int(rises[0]) if len(rises) else len(beyond) - first)
    best = first + int(np.argmin(beyond[first:end]))
    return float((differs[0] + best) * step_s)


def _uniform(time_s: Array, reference: Array) -> tuple[Array, float]:
    """Sample the reference uniformly, without its mean, in as many points as are needed."""
    points = min(len(time_s), MOST_POINTS)
    grid = np.linspace(time_s[0], time_s[-1], points)
    r = np.interp(grid, time_s, reference)
    return r - r.mean(), float(grid[1] - grid[0]) if points > 1 else 1.0
