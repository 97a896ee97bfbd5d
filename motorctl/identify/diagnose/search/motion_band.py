"""The band in which an axis moves: above it the feedback answers to nothing but measured noise.

There the command is a copy of the noise in the measured acceleration, so that a regression of one
on the other finds delays and resonances of the controller instead of the machine's.
"""

from __future__ import annotations

import numpy as np
from scipy import signal
from scipy.ndimage import median_filter

from motorctl.identify.diagnose.search.held_out_blocks import residual
from motorctl.identify.diagnose.search.hypothesis import Hypothesis

ABOVE_NOISE = 10.0
"""Density of the motion over that of the measurement's noise, where motion is seen. Larger narrows
the band, smaller lets noise widen it. Chosen by hand on the simulated campaign."""
MARGIN = 1.2
"""Band over the highest frequency at which motion is seen. Larger adds noise, smaller cuts the
motion's edge. Chosen by hand on the simulated campaign."""
NARROWEST_HZ = 20.0
"""Narrowest band [Hz]. Larger adds noise to slow motions, smaller hides friction's steps. Chosen by
hand on the simulated campaign."""
LEAST_PART = 0.45
"""Part of the signals' band: motion that reaches so far leaves the band as it is. Larger narrows
more often, smaller keeps noise. Chosen by hand on the simulated campaign."""
LINE_BINS = 7
"""Bins of the spectrum over which the median is taken, so that single lines do not count as motion.
Larger misses narrow motion, smaller lets lines of a disturbance through. Chosen by hand on the
simulated campaign."""


def motion_band_hz(heard: Hypothesis, widest_hz: float) -> float:
    """Return the band for a diagnosis: that of the signals, or of their motion if far less.

    Parameters
    ----------
    heard
        The declared model over the widest band in which motion outweighs the noise.
    widest_hz
        Band of the signals [Hz].
    """
    plain = heard.regressors.signals
    rest = residual(heard.problem, heard.solution.b)[: plain.rows]
    window = min(plain.rows, max(64, int(1.0 / plain.row_period_s)))
    frequency, density = signal.welch(
        heard.regressors.left - rest, 1.0 / plain.row_period_s, nperseg=window, detrend=False
    )
    noise = (2.0 * np.pi * frequency) ** 4 * plain.position_noise * plain.response(frequency) ** 2
    above = median_filter(density, LINE_BINS) > ABOVE_NOISE * noise
    above &= (frequency > 0.0) & (frequency <= plain.band_hz)
    highest = float(frequency[above].max(initial=0.0))
    if highest > LEAST_PART * widest_hz:
        return widest_hz
    return max(MARGIN * highest, min(NARROWEST_HZ, plain.band_hz))
