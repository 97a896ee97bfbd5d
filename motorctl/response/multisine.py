"""A multisine: waves of whole periods at once, their phases such that none of its peaks is high.

Only odd harmonics of its period are in it, and of each group of these one is left out at random:
what a machine answers there, it makes by itself, of what is not linear or by noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GROUP = 4
"""Odd harmonics of which one is left out. Fewer spend the excitation on fewer lines, more look at
fewer places for what is not linear."""
LEAST_HARMONIC = 3
"""Lowest harmonic that is excited. Lower ones are beside the mean, which a window spreads."""
PASSES, CLIP = 200, 0.9
"""How often a wave is clipped and its lines mended, and at which part of its peak. More passes find
little more, fewer leave peaks; by hand."""
SEED = 1
"""Which harmonics are left out; any other would do as well."""


@dataclass(frozen=True)
class Multisine:
    """One period of a multisine."""

    volts: Array
    """(n,) a value a tick [V]."""
    lines: NDArray[np.intp]
    """(k,) harmonics that are in it: n periods of harmonic n in the whole."""
    left_out: NDArray[np.intp]
    """(m,) odd harmonics between these that are not."""


def multisine(
    ticks: int, period_s: float, band_hz: tuple[float, float], peak_v: float
) -> Multisine:
    """Return a multisine with a flat spectrum.

    Schroeder's phases (IEEE Trans. Information Theory 16(1), 1970, pp. 85-89) for a spectrum that
    is flat: the k-th of n waves has the phase -pi k (k - 1)/n. Waves that are left out count.

    Parameters
    ----------
    ticks
        Values in a period.
    period_s
        Time from one to the next [s].
    band_hz
        Lowest and highest frequency [Hz].
    peak_v
        Largest magnitude [V].

    Returns
    -------
    Multisine
        One period of it, and what is in it.
    """
    base_hz = 1.0 / (ticks * period_s)
    first = max(math.ceil(band_hz[0] / base_hz - 1e-9), LEAST_HARMONIC)
    last = math.floor(band_hz[1] / base_hz + 1e-9)
    odd = np.arange(first + 1 - first % 2, last + 1, 2)
    rng = np.random.default_rng(SEED)
    whole = len(odd) // GROUP
    out = GROUP * np.arange(whole) + rng.integers(1, GROUP, whole)  # the first line is kept
    lines = np.delete(odd, out)
    order = np.delete(np.arange(len(odd)), out)
    phases = -np.pi * order * (order + 1) / max(len(odd), 1)
    spectrum = np.zeros(ticks // 2 + 1, np.complex128)
    spectrum[lines] = np.exp(1j * phases)
    wave = _less_peaked(np.fft.irfft(spectrum, ticks), lines)
    volts = wave * (peak_v / np.max(np.abs(wave), initial=1e-300))
    return Multisine(volts, lines, odd[out])


def _less_peaked(wave: Array, lines: NDArray[np.intp]) -> Array:
    """Return a wave with the same lines and lower peaks: clipped and mended, again and again.

    E. Van der Ouderaa, J. Schoukens, J. Renneboog, IEEE Trans. Instrumentation and Measurement
    37(1), 1988, pp. 145-147.
    """
    best = wave
    for _ in range(PASSES):
        peak = CLIP * np.abs(wave).max()
        spectrum = np.fft.rfft(np.clip(wave, -peak, peak))
        mended = np.zeros_like(spectrum)
        mended[lines] = np.exp(1j * np.angle(spectrum[lines]))
        wave = np.fft.irfft(mended, len(wave))
        if np.abs(wave).max() < np.abs(best).max():
            best = wave
    return best
