"""What a motion spans: places, speeds, accelerations, commands, and how slowly it turns round."""

from __future__ import annotations

import math

import numpy as np

from motorctl.identify.columns.reversals import slow_reversal
from motorctl.identify.columns.signals import Signals
from motorctl.model import Spans

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
