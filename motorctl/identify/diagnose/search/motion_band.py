"""The band in which an axis moves: above it the feedback answers to nothing but measured noise.

There the command is a copy of the noise in the measured acceleration, so that a regression of one
on the other finds delays and resonances of the controller instead of the machine's. A wave over
position is no such noise: at speed it lies above the motion, and a slow loop hardly answers to it.
"""

from __future__ import annotations

import numpy as np
from scipy import signal
from scipy.ndimage import median_filter

from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.search.forms import best_form
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

WAVE_LEAVES = 0.8
"""Part of the squared residual that an error of the encoder leaves over the wider band at most, for
a wave to be there. Larger widens the band for chance lines, smaller misses weak waves. Chosen by
hand on machines of other hands: encoders that are wrong leave 0.09 to 0.58, cogging 0.65 to 0.89,
all others 0.91 and more."""


def motion_band_hz(heard: Hypothesis, widest_hz: float) -> float:
    """Return the band for a diagnosis: that of the signals, or of their motion if far less.

    Where a wave over position shows beyond the motion, the one in which motion outweighs the noise.

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
    narrow = max(MARGIN * highest, min(NARROWEST_HZ, plain.band_hz))
    return plain.band_hz if _wave_shows_beyond(narrow, heard) else narrow


def _wave_shows_beyond(band_hz: float, heard: Hypothesis) -> bool:
    """Return whether a wave over position that is faster than a band at speed takes a good part."""
    if not band_hz < heard.regressors.signals.band_hz:
        return False
    heard = heard.refreshed()
    waves = [c for c in heard.regressors.catalogue.values() if "wave_of_measurement" in c.groups]
    spans = spans_of(heard.regressors.signals)
    forms = [best_form(heard, cls, spans, None) for cls in waves]
    return any(
        form.held_out < WAVE_LEAVES * heard.held_out
        and spans.speed_m_s * form.effect.lines[0] > band_hz
        for form in forms
        if form is not None
    )
