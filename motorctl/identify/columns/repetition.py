"""Whether a motion repeats, and after what time: a reference exactly, a measured one nearly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

Array = NDArray[np.float64]

MOST_POINTS = 1 << 16
"""Points of a series that repetition is sought in. Larger takes more time and memory, smaller blurs
the period. Chosen by hand; 2^16 suits the fast Fourier transform."""
FEWEST_POINTS = 16
"""Fewest points from which a repetition is told. Smaller finds one by chance. Chosen by hand."""
UNLIKE = 0.5
"""Squared difference of the reference from itself at a lag, relative to its size, that shows that
it moves at all. Larger misses slow references, smaller takes noise for motion. Chosen by hand."""
ALIKE = 0.01
"""What the squared difference of two periods may be, relative to their own size. Larger calls
similar moves the same, smaller asks more than the sampling of the period allows. Chosen by hand."""
STEP_S = 0.01
"""Time between the points in which a repeated move is sought [s]. Larger blurs the period, smaller
takes time. Chosen by hand."""
LEAST_PERIOD_S = 0.3
"""Shortest repeated move that is sought [s]. Smaller takes vibration for a move, larger misses fast
ones. Chosen by hand."""
FEWEST_PERIODS = 3
"""Periods that must lie in a recording for it to repeat. Smaller calls a coincidence a repetition,
larger misses long moves. Chosen by hand."""
SAME = 0.9
"""Correlation of the velocity with itself a period later, at least. Larger misses repetition under
noise, smaller finds it in unlike moves. Chosen by hand."""
MOVING = 0.1
"""Part of the top speed that counts as motion. Larger misses slow moves, smaller counts noise as
turns. Chosen by hand."""
TURNS_OF_ONE = 2.5
"""Turns in a period of one move there and back, at most: two, and half a one for noise. Larger
calls many moves one, smaller misses a plain one. Arithmetic, the half chosen by hand."""


def repeats(time_s: Array, reference: Array, period_s: float) -> bool:
    """Return whether the last period of a reference is like the one before.

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


def find_period(time_s: Array, reference: Array, shown: float = 2.0) -> float | None:
    """Find the shortest period that shows at least so many times; None where nothing repeats.

    The squared difference d(lag) = |r(t) - r(t - lag)|^2 / (|r(t)|^2 + |r(t - lag)|^2) comes from
    the autocorrelation; the period is its first deep minimum beyond the lags at which the motion
    differs from itself.
    """
    r, step_s = _uniform(time_s, reference)
    n = len(r)
    power = np.concatenate(([0.0], np.cumsum(r**2)))
    if n < FEWEST_POINTS or power[-1] == 0.0:
        return None
    lags = np.arange(int(n / shown) + 1)
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


def period_of(velocity: Array, sample_period_s: float) -> float:
    """Return the period [s] of one move, there and back, that is made again and again; else 0."""
    every = max(1, round(STEP_S / sample_period_s))
    v, step_s = velocity[::every], every * sample_period_s
    lags = np.arange(max(1, int(LEAST_PERIOD_S / step_s)), len(v) // FEWEST_PERIODS)
    if len(lags) < 3 or not v.any():
        return 0.0
    size = 2 * len(v)
    same = np.fft.irfft(np.abs(np.fft.rfft(v, size)) ** 2, size)[: len(v)]
    power = np.cumsum(v**2)
    # the overlapping parts' own energies: first ones without their end, last ones without the start
    energy = np.sqrt(power[len(v) - 1 - lags] * (power[-1] - power[lags - 1]))
    likeness = same[lags] / np.maximum(energy, 1e-300)
    inner = (likeness[1:-1] >= likeness[:-2]) & (likeness[1:-1] >= likeness[2:])
    again = np.flatnonzero(inner & (likeness[1:-1] > SAME)) + 1
    if len(again) == 0:
        return 0.0
    left, peak, right = likeness[again[0] - 1 : again[0] + 2]
    bend = left - 2.0 * peak + right
    offset = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    period_s = float((lags[again[0]] + offset) * step_s)
    way = np.sign(np.where(np.abs(v) > MOVING * np.abs(v).max(), v, 0.0))
    turns = int(np.sum(np.diff(way[way != 0.0]) != 0.0))
    return period_s if turns * period_s < TURNS_OF_ONE * len(v) * step_s else 0.0
