"""The band in which an axis moves: above it the feedback answers to nothing but measured noise.

There the command is a copy of the noise in the measured acceleration, so that a regression of one
on the other finds delays and resonances of the controller instead of the machine's.
"""

from __future__ import annotations

import numpy as np
from scipy import signal
from scipy.ndimage import median_filter

from motorctl.identify.columns.frame import Frame, low_pass_response
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks, residual
from motorctl.identify.diagnose.search.hypothesis import Bench, Hypothesis
from motorctl.model import EffectList

ABOVE_NOISE = 10.0
"""Density of the motion over that of the measurement's noise."""
MARGIN = 1.2
NARROWEST_HZ = 20.0
LEAST_PART = 0.45
"""Of the frame's band: motion that reaches so far leaves the band as it is."""
LINE_BINS = 7


def motion_band_hz(frame: Frame, model: EffectList) -> float:
    """Give the band for a diagnosis: the frame's own, or that of its motion if that is far less."""
    plain = frame.with_response(low_pass_response(frame.band_hz))
    bench = Bench(plain, model, make_blocks(plain.rows, plain.row_period_s))
    hypothesis = Hypothesis(bench)
    rest = residual(hypothesis.problem, hypothesis.solution.b)[: plain.rows]
    window = min(plain.rows, max(64, int(1.0 / plain.row_period_s)))
    frequency, density = signal.welch(
        bench.left - rest, 1.0 / plain.row_period_s, nperseg=window, detrend=False
    )
    noise = (2.0 * np.pi * frequency) ** 4 * plain.position_noise * plain.response(frequency) ** 2
    above = median_filter(density, LINE_BINS) > ABOVE_NOISE * noise
    above &= (frequency > 0.0) & (frequency <= plain.band_hz)
    highest = float(frequency[above].max(initial=0.0))
    if highest > LEAST_PART * frame.band_hz:
        return frame.band_hz
    return max(MARGIN * highest, NARROWEST_HZ)
