"""Compiled playback of segment tables, for the tick: constant time, no allocation."""

from __future__ import annotations

from motorctl.kernels import inner_kernel
from motorctl.motion.segments import Segments


@inner_kernel
def evaluate(segments: Segments, count: int, index: int, s: float) -> tuple[float, float, float]:
    """Return x [m], v [m/s], a [m/s^2] at the time s [s] within segment `index` of `count` >= 1.

    Outside the table, and outside the segment, the nearest state of it.
    """
    i = min(max(index, 0), count - 1)
    segment = segments[i]
    t = segment["duration_s"] if index >= count else min(max(s, 0.0), segment["duration_s"])
    c = segment["c"]
    x = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    v = c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])))
    a = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]))
    return x, v, a


@inner_kernel
def advance(
    segments: Segments, count: int, index: int, s: float, dt: float
) -> tuple[int, float, bool]:
    """Move dt [s] on -> (index, s, done); at the end: the last segment at its end, and done.

    What is left of a tick is carried over into the next segment, so no time is lost.
    """
    s += dt
    while s >= segments[index]["duration_s"]:
        if index >= count - 1:
            return index, segments[index]["duration_s"], True
        s -= segments[index]["duration_s"]
        index += 1
    return index, s, False
