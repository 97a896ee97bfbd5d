"""Segment tables: pieces of quintic polynomials, one after the other in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SEGMENT = np.dtype([("duration_s", "f8"), ("c", "f8", (6,))])
"""x(s) = c0 + c1 s + ... + c5 s^5 [m] for the time s [s] within the segment, 0 <= s <= duration."""

MOST_SEGMENTS = 65_000
"""Longest table of a program's axis; what plays it needs room for the approach besides."""

Segments = NDArray[np.void]
Array = NDArray[np.float64]


def derivatives(coefficients: Array, s: Array) -> tuple[Array, Array, Array]:
    """Evaluate quintics (N, 6) at times s [s] (N,) or (N, M) -> x, v, a of the shape of s."""
    c = coefficients if s.ndim == 1 else coefficients[:, :, np.newaxis]
    c0, c1, c2, c3, c4, c5 = (c[:, k] for k in range(6))
    x = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    v = c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
    a = 2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))
    return x, v, a


def rest_segment(position_m: float, duration_s: float) -> Segments:
    """Make one segment that stands at `position_m` [m] for `duration_s` [s]."""
    segments = np.zeros(1, SEGMENT)
    segments["duration_s"] = duration_s
    segments["c"][0, 0] = position_m
    return segments


def jerk_segments(
    start_m: float, end_m: float, durations_s: ArrayLike, jerks_m_s3: ArrayLike
) -> Segments:
    """Integrate phases of constant jerk from rest at `start_m` to rest at `end_m`.

    `durations_s` (N,) [s], `jerks_m_s3` (N,) [m/s^3]; phases without duration vanish. The phases
    must lead to `end_m` but for rounding, which the last one takes up: the end is exact.
    """
    durations = np.asarray(durations_s, np.float64)
    jerks = np.asarray(jerks_m_s3, np.float64)
    kept = durations > 0
    durations, jerks = durations[kept], jerks[kept]
    segments = np.zeros(len(durations), SEGMENT)
    segments["duration_s"] = durations
    x, v, a = float(start_m), 0.0, 0.0
    for row, t, j in zip(segments["c"], durations, jerks, strict=True):
        row[:4] = x, v, a / 2, j / 6
        x += t * (v + t * (a / 2 + t * j / 6))
        v += t * (a + t * j / 2)
        a += t * j
    segments["c"][-1, 0] += end_m - x
    return segments


def hermite_segments(durations_s: ArrayLike, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Segments:
    """Join states x, v, a, each (N + 1,), by quintics lasting `durations_s` (N,): C2 throughout."""
    t = np.asarray(durations_s, np.float64)
    x, v, a = (np.asarray(array, np.float64) for array in (x, v, a))
    segments = np.zeros(len(t), SEGMENT)
    segments["duration_s"] = t
    # What is left at the end of each piece once its start's x, v, a are taken into account,
    # scaled to a piece of duration one.
    dx = np.diff(x) - t * (v[:-1] + t * a[:-1] / 2)
    dv = t * (np.diff(v) - t * a[:-1])
    da = t * t * np.diff(a)
    c = segments["c"]
    c[:, 0], c[:, 1], c[:, 2] = x[:-1], v[:-1], a[:-1] / 2
    c[:, 3] = (10 * dx - 4 * dv + da / 2) / t**3
    c[:, 4] = (-15 * dx + 7 * dv - da) / t**4
    c[:, 5] = (6 * dx - 3 * dv + da / 2) / t**5
    return segments
