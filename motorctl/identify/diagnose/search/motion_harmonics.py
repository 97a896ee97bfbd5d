"""Waves over time that are harmonics of the motion itself: what any bent force makes of a swing.

An axis that swings at one frequency shows friction, saturation or a force of the place at multiples
of it. A wave over time of such a frequency explains that as well, whatever it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.forms import Form

Array = NDArray[np.float64]

MOST_PART = 0.75
"""Part of the velocity's variance that one sine takes, from which the motion is a swing of that
frequency. Larger names the harmonics of bent swings disturbances, smaller doubts disturbances in
motion of many frequencies. Chosen by hand: a triangle's velocity has 0.81."""
HIGHEST_ORDER = 12
"""Highest multiple of the motion's frequency that may be its harmonic. Larger doubts fans and
mains beside slow motion, smaller names what sharp corners make. Chosen by hand: of a force that
turns over at once, the thirteenth has a thirteenth of the first."""
AS_NEAR = 0.5
"""Distance of a wave from such a multiple, over the finest that a recording of that length tells
apart, up to which they are one. Larger doubts true disturbances, smaller names harmonics whose
frequency is not met exactly. Chosen by hand."""
OVERSAMPLING = 8
"""Points of the velocity's spectrum for each independent one. Fewer miss the top of its line, more
takes time. Chosen by hand: at 8, and a parabola between, the thirteenth multiple is met."""


def without_harmonics(signals: Signals, forms: list[Form]) -> list[Form]:
    """Return forms without waves over time that are harmonics of the motion."""
    waves = [form for form in forms if "wave_over_time" in form.effect.groups]
    if not waves or not (frequency := swing_hz(signals)):
        return forms
    finest = AS_NEAR / (float(signals.time_s[-1] - signals.time_s[0]) or 1.0)
    return [f for f in forms if f not in waves or not _is_harmonic(f, frequency, finest)]


def swing_hz(signals: Signals) -> float:
    """Return the frequency [Hz] of an axis that swings like a sine; 0.0 where it does not."""
    longest = max(signals.stretches, key=lambda s: len(s.v))
    v = longest.v[:: signals.decimation]
    v = v - v.mean()
    size = fft.next_fast_len(OVERSAMPLING * len(v), real=True)
    density = np.abs(fft.rfft(v * np.hanning(len(v)), size))
    k = int(np.argmax(density))
    if not 0 < k < len(density) - 1:
        return 0.0
    left, top, right = density[k - 1 : k + 2]
    offset = 0.5 * (left - right) / min(left - 2.0 * top + right, -1e-300)
    frequency = (k + offset) / (size * signals.row_period_s)
    angle = 2.0 * np.pi * frequency * signals.row_period_s * np.arange(len(v))
    columns = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    rest = v - columns @ np.linalg.lstsq(columns, v, rcond=None)[0]
    swings = float(rest @ rest) < (1.0 - MOST_PART) * float(v @ v)
    return float(frequency) if swings else 0.0


def _is_harmonic(form: Form, frequency_hz: float, finest_hz: float) -> bool:
    """Return whether each line of a wave is a multiple of the motion's frequency."""
    orders = np.array(form.effect.lines) / frequency_hz
    near = np.abs(orders - np.rint(orders)) * frequency_hz < finest_hz
    return bool(np.all(near & (np.rint(orders) >= 1) & (np.rint(orders) <= HIGHEST_ORDER)))
