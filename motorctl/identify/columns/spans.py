"""What a motion spans: places, speeds, accelerations, commands, and how slowly it turns round."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from motorctl.identify.columns.signals import Signals
from motorctl.model import Spans

Array = NDArray[np.float64]

SEEN = 20.0
"""Way after a reversal, in multiples of the position's noise, by which it is one. Larger overlooks
short strokes, smaller takes noise for reversals. Chosen by hand."""
SLOW_ONES = 20.0
"""Percentile of the reversals' accelerations that is the slow ones': a fifth of them are enough to
show an effect. Larger doubts what few reversals show, smaller trusts single ones. Chosen by
hand."""
UNIFORM = math.sqrt(12.0)
"""Count of an encoder over the rms of its rounding error: that of a uniform distribution."""


def spans_of(signals: Signals) -> Spans:
    """Return what the rows of the signals span."""
    x = np.concatenate([s.x for s in signals.stretches])
    v = np.concatenate([s.v for s in signals.stretches])
    a = np.gradient(v, signals.period_s)
    others = signals.stretches[0].others
    resolution = signals.data.resolution
    turns = [
        slow_reversal(s.x, signals.position_noise_rms, signals.period_s) for s in signals.stretches
    ]
    ways = {bool(s.x[-1] > s.x[0]) for s in signals.stretches}
    return Spans(
        position_m=(float(x.min()), float(x.max())),
        speed_m_s=float(np.percentile(np.abs(v), 99.5)),
        acceleration_m_s2=float(np.percentile(np.abs(a), 99.5)),
        command_v=signals.largest_command,
        time_s=(float(signals.stretches[0].time_s[0]), float(signals.stretches[-1].time_s[-1])),
        period_s=signals.period_s,
        band_hz=signals.band_hz,
        resolution_m=max(resolution or 0.0, UNIFORM * signals.position_noise_rms),
        other_axes=tuple(others),
        rotary=signals.data.position_unit == "rad",
        reversal_m_s2=min(filter(None, turns), default=0.0),
        one_way=len(ways) == 1 and not any(turns),
    )


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
