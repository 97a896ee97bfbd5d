"""Exact extrema of polynomials over an interval, many at once.

Between the zeros of its derivative a polynomial is monotonic, so each such interval holds at most
one zero of its own, which bisection finds to the last bit. Starting from the linear derivative
this walks up to the zeros of any degree, without the division by a vanishing leading
coefficient that companion matrices and closed formulas suffer from.
"""

from __future__ import annotations

import numpy as np

from motorctl.motion.segments import Array, Segments

_BISECTIONS = 60
_BLOCK = 4096

Extrema = tuple[float, float, float, float]
"""Lowest value, its time, highest value, its time."""


def signed_extrema(segments: Segments, starts_s: Array) -> list[Extrema]:
    """Find the extremes of x, v, a and jerk of a table (N,) whose segments start at `starts_s`."""
    blocks = [
        _block_extrema(segments[i : i + _BLOCK], starts_s[i : i + _BLOCK])
        for i in range(0, len(segments), _BLOCK)
    ]
    return [_join(parts) for parts in zip(*blocks, strict=True)]


def _block_extrema(segments: Segments, starts_s: Array) -> list[Extrema]:
    duration = segments["duration_s"]
    # In u = s / duration every interval is [0, 1]; a segment without duration has only its start.
    scale = np.where(duration > 0, duration, 1.0)
    polynomial: Array = segments["c"] * (duration[:, None] ** np.arange(6))
    ladder: list[Array] = [polynomial]
    for _ in range(4):
        ladder.append(_derivative(ladder[-1]))
    zeros = -_safe_ratio(ladder[4][:, 0], ladder[4][:, 1])[:, None]
    breaks = np.clip(zeros, 0.0, 1.0)
    found = []
    for order in (3, 2, 1, 0):
        candidates = _with_ends(breaks)
        values = _values(ladder[order], candidates) / scale[:, None] ** order
        times = starts_s[:, None] + candidates * duration[:, None]
        lowest, highest = np.argmin(values), np.argmax(values)
        found.append(
            (
                float(values.flat[lowest]),
                float(times.flat[lowest]),
                float(values.flat[highest]),
                float(times.flat[highest]),
            )
        )
        breaks = _zeros_between(ladder[order], candidates)
    return found[::-1]


def _zeros_between(polynomial: Array, points: Array) -> Array:
    """Find the zero in each interval of sorted points (N, M) -> (N, M - 1), else one of its ends.

    The polynomials (N, K) must be monotonic within each interval.
    """
    low, high = points[:, :-1].copy(), points[:, 1:].copy()
    negative_left = _values(polynomial, low) < 0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        left = (_values(polynomial, middle) < 0) == negative_left
        low = np.where(left, middle, low)
        high = np.where(left, high, middle)
    return (low + high) / 2


def _derivative(polynomial: Array) -> Array:
    return polynomial[:, 1:] * np.arange(1, polynomial.shape[1])


def _values(polynomial: Array, u: Array) -> Array:
    value = np.zeros_like(u)
    for k in range(polynomial.shape[1] - 1, -1, -1):
        value = value * u + polynomial[:, k : k + 1]
    return value


def _with_ends(breaks: Array) -> Array:
    rows = len(breaks)
    return np.hstack([np.zeros((rows, 1)), breaks, np.ones((rows, 1))])


def _safe_ratio(above: Array, below: Array) -> Array:
    return np.divide(above, below, out=np.zeros_like(above), where=below != 0)


def _join(parts: tuple[Extrema, ...]) -> Extrema:
    low = min((p[0], p[1]) for p in parts)
    high = max((p[2], -p[3]) for p in parts)
    return low[0], low[1], high[0], -high[1]
