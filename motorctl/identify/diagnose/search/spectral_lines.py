"""Spectra of what is left, over position and over time: where periodic effects show as lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from motorctl.identify.columns.signals import Signals

Array = NDArray[np.float64]

CYCLES_PER_TRAVEL = 500.0
"""Finest wave that is sought, in cycles over the travel: magnets and screws repeat a hundred times
or so, with some orders each. Larger takes time and finds chance lines, smaller misses fine pitches.
Chosen by hand."""
FEWEST_CYCLES = 3.4
"""Cycles over the travel: what repeats less often is no periodic force. Larger misses long pitches,
smaller takes slow variation for one. Arithmetic: just above the 1 / 0.3 = 3.3 of the longest
pitch."""
OVERSAMPLING = 8
"""Points of the spectrum for each independent one. Fewer may miss a line's top, more takes time.
Chosen by hand: at 8 a line lies within a sixteenth of its width."""
BAND_PART = 0.45
"""Part of the band that the finest wave may reach in slow motion. Larger takes what the filter's
edge lets through for a line, smaller misses fine pitches. Chosen by hand."""
CELLS_PER_WAVE = 4.0
"""Places into which the finest wave is cut. More takes time, fewer blurs it: 2 would be Nyquist's
limit. Chosen by hand: twice that."""
SPEED_BINS = 64
"""Bins of speed from which the filter's loss is told. More takes time, fewer is coarser. Chosen by
hand."""


PLACES = 40
"""Places over the travel at which it is asked whether a wave is seen. More leaves places with few
rows, fewer hides gaps. Chosen by hand on the simulated campaign."""
LEAST_COVERED = 0.1
"""Part of the places, over the travel, at which a wave must be slow enough to be seen. Larger
misses fine pitches, smaller names waves that single turning points make. Chosen by hand on the
simulated campaign."""
COVERED_WAVES = 24
"""Wave numbers, evenly spread over their logarithm, at which that part is told; between them it is
interpolated. More takes time, fewer rounds off where it falls. Chosen by hand."""
SLOW_PERCENT = 25.0
"""Percentile of the speed that stands for slow motion. Larger misses pitches that only slow motion
shows, smaller names what few rows show. Chosen by hand."""


def position_spectrum(
    signals: Signals, left_over: Array, weight: Array | None
) -> tuple[Array, Array]:
    """Return wave numbers [cycles/unit] and the gain in squared residual of a line at each.

    left_over (m,) are whitened rows; weight (m,) multiplies the line (the command, for ripple).
    """
    x, v = signals.picked(lambda s: s.x), signals.picked(lambda s: s.v)
    low, travel = float(x.min()), float(np.ptp(x))
    finest = min(CYCLES_PER_TRAVEL / travel, BAND_PART * signals.band_hz / _slow(v))
    r = adjoint(signals, left_over)
    w = np.ones_like(r) if weight is None else weight
    cell = 1.0 / (CELLS_PER_WAVE * finest)
    bins = int(travel / cell) + 2
    place = (x - low) / cell
    index = place.astype(int)
    share = place - index
    value = r * w
    folded = np.bincount(index, value * (1.0 - share), bins)
    folded += np.bincount(index + 1, value * share, bins)[:bins]
    size = fft.next_fast_len(OVERSAMPLING * bins, real=True)
    line = fft.rfft(folded, size)
    kappa = np.arange(len(line)) / (size * cell)
    used = (kappa >= FEWEST_CYCLES / travel) & (kappa <= finest)
    kappa, line = kappa[used], line[used]
    if len(kappa) == 0:
        return kappa, np.zeros(0)
    # linear sharing between cells damps short waves
    line = line / np.sinc(kappa * cell) ** 2
    least = 1e-12 * float(w @ w) + 1e-300  # of a line that hardly passes the filter at any speed
    gain = np.abs(line) ** 2 / np.maximum(_energy(signals, v, w, kappa), least)
    return kappa, np.where(_covered(signals, place / bins, v, kappa) > LEAST_COVERED, gain, 0.0)


def time_spectrum(signals: Signals, left_over: Array) -> tuple[Array, Array]:
    """Return frequencies [Hz] and the gain in squared residual of a line at each."""
    t = signals.time_s
    r = adjoint(signals, left_over)
    first, period = float(t[0]), signals.row_period_s
    index = np.round((t - first) / period).astype(int)
    rows = np.bincount(index, r)
    size = fft.next_fast_len(4 * len(rows), real=True)
    line = fft.rfft(rows, size)
    frequency = np.arange(len(line)) / (size * period)
    duration = float(t[-1] - first)
    used = (frequency >= 2.0 / duration) & (frequency <= signals.band_hz)
    energy = 0.5 * len(r) * signals.response(frequency[used]) ** 2
    return frequency[used], np.abs(line[used]) ** 2 / np.maximum(energy, 1e-6 * len(r))


def without_sines(time_s: Array, rows: Array, lines_hz: Sequence[float]) -> Array:
    """Return what a constant and sines of these frequencies [Hz] leave of rows, (m,)."""
    angles = [2.0 * np.pi * line * time_s for line in lines_hz]
    waves = [f(angle) for angle in angles for f in (np.sin, np.cos)]
    columns = np.stack([*waves, np.ones(len(rows))], axis=1)
    return np.asarray(rows - columns @ np.linalg.lstsq(columns, rows, rcond=None)[0])


def strongest(place: Array, gain: Array, count: int) -> list[float]:
    """Return the places of the highest peaks, highest first."""
    inner = np.flatnonzero((gain[1:-1] >= gain[:-2]) & (gain[1:-1] >= gain[2:])) + 1
    order = inner[np.argsort(gain[inner])[::-1][:count]]
    return [float(place[i]) for i in order]


def adjoint(signals: Signals, rows: Array) -> Array:
    """Pass rows through the signals' filter once more: what correlates with unfiltered columns."""
    parts, start = [], 0
    for kept in signals.kept:
        count = int(kept.sum())
        spread = np.zeros(len(kept))
        spread[kept] = rows[start : start + count]
        start += count
        parts.append(spread[None])
    return np.asarray(signals.filtered(parts, signals.decimation)[0])


def _energy(signals: Signals, v: Array, weight: Array, kappa: Array) -> Array:
    """Return the energy that the filter leaves of half a line, from the speeds at the rows."""
    speed = np.abs(v)
    edges = np.linspace(0.0, float(speed.max()) * 1.0001 + 1e-12, SPEED_BINS + 1)
    index = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, SPEED_BINS - 1)
    mass = np.bincount(index, weight**2, SPEED_BINS)
    middle = 0.5 * (edges[1:] + edges[:-1])
    passed = signals.response(np.outer(kappa, middle).ravel()).reshape(len(kappa), -1) ** 2
    return np.asarray(0.5 * passed @ mass)


def _covered(signals: Signals, place: Array, v: Array, kappa: Array) -> Array:
    """Return the part of the travel over which waves pass the filter, in effect; place is 0 to 1.

    Short waves pass only where the axis is slow: if that is at the ends of its moves alone, they
    fit whatever happens there.
    """
    index = np.minimum((place * PLACES).astype(int), PLACES - 1)
    some = np.geomspace(float(kappa[0]), float(kappa[-1]), COVERED_WAVES)
    covered = np.empty(len(some))
    for k, wave in enumerate(some):
        energy = np.bincount(index, signals.response(wave * np.abs(v)) ** 2, PLACES)
        covered[k] = energy.sum() ** 2 / max(float(energy @ energy), 1e-300) / PLACES
    return np.asarray(np.interp(kappa, some, covered))


def _slow(v: Array) -> float:
    """Return a speed that a good part of the rows stay below."""
    return max(float(np.percentile(np.abs(v), SLOW_PERCENT)), 1e-9)
