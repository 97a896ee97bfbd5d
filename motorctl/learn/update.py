"""From what repeated in one run to what is added in the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.learn.cycles import Repetition
from motorctl.learn.robust_filter import LearningFilter

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

CLEAR_OF_NOISE = 4.0
"""By how much a line of the error must exceed its own variance before any of it is learned. Less
learns noise, which then repeats; more leaves small errors. Of lines that are only noise, one in 50
exceeds it. Arithmetic."""


def clear_error(repetition: Repetition) -> ComplexArray:
    """Return the spectrum of what repeats, without what may be noise: what can be learned from.

    Each line is made smaller by a factor between 0 and 1, so that what shrinks goes on shrinking.
    """
    error, variance = repetition.spectrum()
    power = np.abs(error) ** 2
    clear = np.zeros(len(error))
    seen = power > CLEAR_OF_NOISE * variance
    clear[seen] = 1.0 - CLEAR_OF_NOISE * variance[seen] / power[seen]
    result: ComplexArray = clear * error
    return result


def learnable_rms_m(repetition: Repetition) -> float:
    """Return how much of the error can be learned from [m rms]."""
    return float(np.sqrt(np.mean(np.fft.irfft(clear_error(repetition), repetition.points) ** 2)))


def next_voltage(repetition: Repetition, filters: LearningFilter, limit_v: float) -> Array:
    """Return what is added in the next repetition, (points,) over the cycle [V].

    Parameters
    ----------
    repetition
        What the last one did, and what was added meanwhile.
    filters
        For this cycle.
    limit_v
        Beyond which nothing is added [V].
    """
    added = np.fft.rfft(repetition.learned)
    wanted = filters.robust * (added - filters.inverse * clear_error(repetition))
    volts: Array = np.fft.irfft(wanted, repetition.points)
    return np.clip(volts, -limit_v, limit_v)
