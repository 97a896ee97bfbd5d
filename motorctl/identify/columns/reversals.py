"""Where a motion turns round, and how slowly it does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

Array = NDArray[np.float64]

SEEN = 20.0
"""Way after a reversal, in multiples of the position's noise, by which it is one. Larger overlooks
short strokes, smaller takes noise for reversals. Chosen by hand."""
SLOW_ONES = 20.0
"""Percentile of the reversals' accelerations that is the slow ones': a fifth of them are enough to
show an effect. Larger doubts what few reversals show, smaller trusts single ones. Chosen by
hand."""


def turning_points(x: Array, way: float) -> NDArray[np.intp]:
    """Return where positions (N,) turn round and go back by at least a way, in their order."""
    return np.sort(np.concatenate([find_peaks(s * x, prominence=way)[0] for s in (1.0, -1.0)]))


def slow_reversal(x: Array, noise: float, period_s: float) -> float | None:
    """Return the acceleration with which the slower reversals are left, None where none is.

    What happens within micrometres of a reversal shows by it.

    Parameters
    ----------
    x
        Smoothed position, (N,).
    noise
        Its noise before it was smoothed, rms, in its unit.
    period_s
        Time between samples [s].
    """
    way = max(SEEN * noise, 1e-6 * float(np.ptp(x)))
    if not way > 0.0:
        return None
    turns = turning_points(x, way)
    if not len(turns):
        return None
    found = []
    for turn, after in zip(turns, np.append(turns[1:], len(x)), strict=True):
        gone = np.abs(x[turn:after] - x[turn])
        beyond = int(np.argmax(gone >= way))
        if gone[beyond] < way:
            continue
        left = beyond - int(np.argmax(gone[beyond::-1] <= 0.25 * way))
        # at a steady acceleration a quarter of the way takes half of the time, and the root of the
        # way grows evenly with time
        root = np.sqrt(gone[left : beyond + 1] / way)
        begin, end = np.interp([0.5, 1.0], root, np.arange(left, beyond + 1))
        found.append(2.0 * way / (2.0 * max(end - begin, 0.5) * period_s) ** 2)
    return float(np.percentile(found, SLOW_ONES)) if found else None
