"""Zero-phase filters, derivatives and decimation of recorded columns."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]
Sections = NDArray[np.float64]
FilterKind = Literal["butterworth", "bessel"]
Derivative = Literal["second_difference", "central"]

CHEBYSHEV_RIPPLE_DB = 0.05
"""Ripple in the pass band of the decimation filter [dB]. Larger distorts amplitudes, smaller widens
the transition. Convention: scipy.signal.decimate takes the same."""
CHEBYSHEV_EDGE = 0.8
"""Pass band of the decimation filter, as a part of the new Nyquist frequency. Larger lets aliases
through, smaller loses band. Convention: scipy.signal.decimate takes the same."""


def low_pass(kind: FilterKind, order: int, cutoff_hz: float, sample_rate_hz: float) -> Sections:
    """Design a low pass; gives second-order sections of shape (ceil(order / 2), 6)."""
    if kind == "bessel":
        sections = signal.bessel(order, cutoff_hz, fs=sample_rate_hz, norm="mag", output="sos")
    else:
        sections = signal.butter(order, cutoff_hz, fs=sample_rate_hz, output="sos")
    return np.asarray(sections, dtype=np.float64)


def decimation_filter(order: int, factor: int) -> Sections:
    """Design the Chebyshev low pass that goes before keeping every `factor`-th sample."""
    sections = signal.cheby1(order, CHEBYSHEV_RIPPLE_DB, CHEBYSHEV_EDGE / factor, output="sos")
    return np.asarray(sections, dtype=np.float64)


def zero_phase(sections: Sections, order: int, columns: Array) -> Array:
    """Filter forward and backward along the first axis.

    The ends are continued by 3 `order` samples, point-mirrored at the end value.
    """
    return np.asarray(signal.sosfiltfilt(sections, columns, axis=0, padlen=3 * order))


def one_way(sections: Sections, columns: Array) -> Array:
    """Filter forward only along the first axis, from a steady state at the first sample."""
    state = signal.sosfilt_zi(sections)
    start = state.reshape(state.shape + (1,) * (columns.ndim - 1)) * columns[:1]
    filtered, _ = signal.sosfilt(sections, columns, axis=0, zi=start)
    return np.asarray(filtered)


def settling_samples(sections: Sections, decay: float) -> int:
    """Count the samples after which the filter's slowest mode has decayed to `decay`."""
    _, poles, _ = signal.sos2zpk(sections)
    slowest = float(np.max(np.abs(poles)))
    return math.ceil(math.log(decay) / math.log(slowest))


def picked(samples: int, factor: int) -> NDArray[np.int64]:
    """Return the indices that decimation keeps: every `factor`-th, counted from the last."""
    return np.arange((samples - 1) % factor, samples, factor, dtype=np.int64)


def velocity_of(position: Array, period_s: float) -> Array:
    """Differentiate by central differences, one-sided at the ends; shape (N,) to (N,)."""
    return np.asarray(np.gradient(position, period_s))


def acceleration_of(position: Array, velocity: Array, period_s: float, how: Derivative) -> Array:
    """Return the acceleration, shape (N,).

    "second_difference" spans two periods, "central" differentiates `velocity` once more and
    spans four.
    """
    if how == "central":
        return velocity_of(velocity, period_s)
    return second_difference(position, period_s)


def second_difference(position: Array, period_s: float) -> Array:
    """Return the second difference over the period squared, (N,); the ends repeat their neighbours.

    Parameters
    ----------
    position
        Shape (N,).
    period_s
        Between two samples [s].
    """
    result = np.empty_like(position)
    result[1:-1] = np.diff(position, 2) / period_s**2
    result[0], result[-1] = result[1], result[-2]
    return result
