"""Frequency responses from the signals of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.report.pictures.statistics import unbroken

Array = NDArray[np.float64]

SHORTEST_WINDOW = 16
"""Fewest rows of a spectrum's window. Smaller tells no frequency from the next. Chosen by hand."""
LONGEST_WINDOW_S = 1.0
"""Longest window of a spectrum [s]. Larger averages fewer windows, so the response is noisier;
smaller blurs resonances (width 1/window). Chosen by hand."""
REST_WAY = 1e-3
"""Way over travel that an axis may have made during a gap and still count as at rest. Larger joins
what does not belong together, smaller wastes stretches. Chosen by hand."""
LONGEST_REST_S = 10.0
"""Longest gap that is bridged as a rest [s]. Larger bridges gaps in which anything may have
happened, smaller wastes stretches. Chosen by hand."""


@dataclass(frozen=True)
class Response:
    """A frequency response estimated from signals; arrays of shape (k,)."""

    frequency_hz: Array
    gain: NDArray[np.complex128]
    std_error: Array
    """Of the gain, in any direction of the complex plane."""


def frequency_response(
    time_s: Array,
    source: Array,
    answer: Array,
    band_hz: float,
    instrument: Array | None = None,
    bins: int = 24,
) -> Response:
    """Estimate answer / source over frequency from cross spectra (Welch, Hann windows).

    `instrument` is a signal that drives both and knows nothing of the noise in either, such as
    the reference: without it noise that goes round the loop biases the ratio (Pintelon and
    Schoukens, System Identification, 2012, section 2.6). Neighbouring lines are put together into
    at most `bins` bins, evenly on a logarithmic scale. Empty where no stretch without a gap is
    long enough.
    """
    period_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    signals = np.stack([source if instrument is None else instrument, source, answer])
    lines, spectra, windows = _cross_spectra(time_s, signals, period_s)
    found = []
    lowest = 1.5 * lines[1] if len(lines) > 1 else band_hz
    edges = np.geomspace(min(lowest, band_hz), band_hz, bins + 1)
    for low, high in pairwise(edges):
        inside = (lines >= low) & (lines < high)
        if not inside.any():
            continue
        # s[i, j]: conj(signal i) times signal j, for instrument z, source u, answer y
        s = spectra[:, :, inside].sum(axis=2)
        if abs(s[0, 1]) == 0.0:
            continue
        gain = s[0, 2] / s[0, 1]
        left = (s[2, 2] - 2.0 * (np.conj(gain) * s[1, 2]) + abs(gain) ** 2 * s[1, 1]).real
        # windows that overlap by half count two thirds each
        count = max(windows * int(inside.sum()) * 2.0 / 3.0, 1.0)
        error = np.sqrt(max(left, 0.0) * s[0, 0].real / (2.0 * count)) / abs(s[0, 1])
        found.append((np.average(lines[inside], weights=_power(spectra, inside)), gain, error))
    table = np.array(found, dtype=np.complex128).reshape(-1, 3)
    return Response(table[:, 0].real, table[:, 1], table[:, 2].real)


def bridge_rests(time_s: Array, position: Array, signals: list[Array]) -> tuple[Array, list[Array]]:
    """Fill gaps in which the axis rested by straight lines: time and signals, all (m,) to (n,).

    At rest the command hardly changes. Without these rows every move would be a stretch of its
    own, and its starts and stops, which tell most, would lie at the ends of windows.
    """
    if len(time_s) < 2:
        return time_s, signals
    period_s = float(np.median(np.diff(time_s)))
    near = REST_WAY * float(np.ptp(position))
    parts = [time_s]
    stretches = list(unbroken(time_s, period_s))
    for before, after in pairwise(stretches):
        last, first = before.stop - 1, after.start
        gap_s = time_s[first] - time_s[last]
        if abs(position[first] - position[last]) <= near and gap_s <= LONGEST_REST_S:
            steps = max(round(gap_s / period_s), 1)
            parts.append(time_s[last] + gap_s * np.arange(1, steps) / steps)
    filled = np.sort(np.concatenate(parts))
    return filled, [np.interp(filled, time_s, signal) for signal in signals]


def _cross_spectra(
    time_s: Array, signals: Array, period_s: float
) -> tuple[Array, NDArray[np.complex128], int]:
    """Return frequencies (f,), sums of conj(signal i) signal j (3, 3, f), and how many windows."""
    stretches = list(unbroken(time_s, period_s))
    lengths = np.array([s.stop - s.start for s in stretches], dtype=np.int64)
    size = _window_size(lengths, round(LONGEST_WINDOW_S / period_s))
    lines = np.fft.rfftfreq(size, period_s).astype(np.float64)
    spectra = np.zeros((3, 3, len(lines)), dtype=np.complex128)
    windows = 0
    if size < SHORTEST_WINDOW:
        return lines[:0], spectra[:, :, :0], 0
    window = np.hanning(size + 1)[:-1]
    for stretch in stretches:
        for first in range(stretch.start, stretch.stop - size + 1, size // 2):
            part = signals[:, first : first + size]
            found = np.fft.rfft(window * (part - part.mean(axis=1, keepdims=True)), axis=1)
            spectra += np.conj(found)[:, None] * found[None, :]
            windows += 1
    return lines, spectra, windows


def _window_size(lengths: NDArray[np.int64], longest: int) -> int:
    """Return the longest power of two that fits into the stretches with half of all rows."""
    size = 1 << int(np.log2(max(min(int(np.max(lengths, initial=0)), longest), 1)))
    while size > 1 and np.sum(lengths[lengths >= size]) < 0.5 * np.sum(lengths):
        size //= 2
    return size


def _power(spectra: NDArray[np.complex128], inside: NDArray[np.bool_]) -> Array:
    power: Array = np.abs(spectra[0, 1, inside])
    return power
