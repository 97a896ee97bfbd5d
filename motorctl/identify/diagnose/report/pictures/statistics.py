"""What the pictures of a diagnosis draw: medians and ratios in bins, spectra along the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST_IN_BIN = 5
"""Fewest rows in a bin that is drawn. Smaller draws noise, larger leaves gaps. Chosen by hand."""
GAP_PERIODS = 1.5
"""Sample periods between two rows from which there is a gap: 1 is none, 2 is one lost row, so half
way. Arithmetic. Larger overlooks lost rows, smaller takes jitter for gaps."""
WEAK_BIN = 0.01
"""A bin whose regressor is weaker than this part of the strongest bin's says nothing. Larger leaves
gaps, smaller draws quotients of noise. Chosen by hand."""
COVERED = 0.3
"""Rows at a place, as a part of the median, below which it counts less in the spectrum. Larger
weakens what is seldom visited, smaller lets single rows make lines. Chosen by hand."""
MOST_POINTS = 1 << 21
"""Points of a spectrum that are summed at once, places times wave numbers. Larger takes more
memory, smaller more time. Chosen by hand."""


@dataclass(frozen=True)
class Bins:
    """Values in bins of a variable; arrays of shape (k,)."""

    centre: Array
    """Median of the variable in the bin."""
    low: Array
    """Lower quartile of the values."""
    middle: Array
    """Median of the values."""
    high: Array
    """Upper quartile of the values."""


def binned(variable: Array, values: Array, edges: Array) -> Bins:
    """Return median and quartiles of values (m,) in the bins between `edges`, (k + 1,).

    Bins with few values are left out, values that are not finite too.
    """
    found = []
    for rows in _members(variable, values, edges):
        found.append((np.median(variable[rows]), *np.percentile(values[rows], (25, 50, 75))))
    table = np.array(found, dtype=np.float64).reshape(-1, 4)
    return Bins(*table.T)


def ratio_in_bins(
    variable: Array, values: Array, regressor: Array, edges: Array
) -> tuple[Array, Array]:
    """Return the bins' centres, and in each the c for which c * regressor is closest to values."""
    found = [
        (
            np.median(variable[rows]),
            values[rows] @ regressor[rows],
            regressor[rows] @ regressor[rows],
        )
        for rows in _members(variable, values, edges)
    ]
    table = np.array(found, dtype=np.float64).reshape(-1, 3)
    strong = table[:, 2] > WEAK_BIN * np.max(table[:, 2], initial=0.0)
    table = table[strong]
    return table[:, 0], table[:, 1] / table[:, 2]


def even_edges(variable: Array, most: int, per_bin: int = 20) -> Array:
    """Return edges of bins of equal width, at most `most`, fewer where there is little data."""
    count = int(np.clip(len(variable) // per_bin, 1, most))
    low, high = float(np.min(variable)), float(np.max(variable))
    return np.linspace(low, high if high > low else low + 1.0, count + 1)


def position_spectrum(position: Array, values: Array, highest: float) -> tuple[Array, Array]:
    """Return wave numbers (k,) up to `highest` [cycles a unit of position] and amplitudes (k,).

    Values are first averaged by place, so that a place where the axis dwells counts no more than
    others. The amplitude of a sine that goes through all of the travel is its own.
    """
    travel = float(np.ptp(position))
    if travel <= 0.0:
        return np.zeros(0), np.zeros(0)
    index, count, weight = _cells(position, highest)
    place = np.bincount(index, position) / count
    mean = np.bincount(index, values) / count
    mean = mean - np.average(mean, weights=weight)
    wave = np.linspace(0.0, highest, int(np.clip(8.0 * highest * travel, 64, 4000)))[1:]
    turns = (weight * mean) / np.sum(weight)
    amplitude = np.empty(len(wave))
    step = max(1, MOST_POINTS // len(place))
    for first in range(0, len(wave), step):
        part = slice(first, first + step)
        amplitude[part] = 2.0 * np.abs(np.exp(-2j * np.pi * np.outer(wave[part], place)) @ turns)
    return wave, amplitude


def position_noise(position: Array, rms: float, highest: float) -> float:
    """Return what 99 % of the amplitudes of `position_spectrum` stay below where values are noise.

    `rms` is that of independent noise in every row. The amplitudes have a Rayleigh distribution.
    """
    if np.ptp(position) <= 0.0:
        return 0.0
    _, count, weight = _cells(position, highest)
    mean_square = 4.0 * rms**2 * np.sum(weight**2 / count) / np.sum(weight) ** 2
    return float(np.sqrt(mean_square * np.log(100.0)))


def unbroken(time_s: Array, period_s: float) -> Iterator[slice]:
    """Yield the stretches of rows between gaps in time."""
    broken = np.flatnonzero(np.diff(time_s) > GAP_PERIODS * period_s) + 1
    edges = [0, *broken.tolist(), len(time_s)]
    for first, last in pairwise(edges):
        if last > first:
            yield slice(first, last)


def since_reversal(position: Array, least: float) -> tuple[Array, Array]:
    """Return the way since motion last turned round, and its direction, both of shape (m,).

    A turn counts once the motion has gone back by `least`. Direction 0: before the first turn.
    """
    way, direction = np.zeros(len(position)), np.zeros(len(position))
    turns = _turns(position, least)
    ends = [row for row, _ in turns[1:]] + [len(position)]
    for (row, heading), end in zip(turns, ends, strict=False):
        way[row:end] = np.abs(position[row:end] - position[row])
        direction[row:end] = heading
    return way, direction


def _turns(position: Array, least: float) -> list[tuple[int, int]]:
    """Return the row of every turn, and the direction after it."""
    turns: list[tuple[int, int]] = []
    heading, low, high = 0, 0, 0
    for k, x in enumerate(position):
        low = k if x < position[low] else low
        high = k if x > position[high] else high
        if heading >= 0 and x < position[high] - least:
            if heading:
                turns.append((high, -1))
            heading, low, high = -1, k, k
        elif heading <= 0 and x > position[low] + least:
            if heading:
                turns.append((low, 1))
            heading, low, high = 1, k, k
    return turns


def _cells(position: Array, highest: float) -> tuple[NDArray[np.int64], Array, Array]:
    """Return the cell of the way that each row lies in, and each cell's rows and weight."""
    low, travel = float(np.min(position)), float(np.ptp(position))
    cells = int(np.clip(4.0 * highest * travel, 16, 1 << 15))
    place = np.minimum(((position - low) / travel * cells).astype(np.int64), cells - 1)
    # only cells that have rows
    index = np.unique(place, return_inverse=True)[1]
    count = np.bincount(index).astype(np.float64)
    return index, count, np.minimum(count / (COVERED * np.median(count)), 1.0)


def _members(variable: Array, values: Array, edges: Array) -> Iterator[NDArray[np.int64]]:
    """Yield the rows of every bin that has enough of them."""
    good = np.flatnonzero(np.isfinite(variable) & np.isfinite(values))
    place = np.searchsorted(edges, variable[good], side="right") - 1
    place[variable[good] == edges[-1]] = len(edges) - 2
    order = np.argsort(place, kind="stable")
    starts = np.searchsorted(place[order], np.arange(len(edges)))
    for first, last in pairwise(starts):
        if last - first >= FEWEST_IN_BIN:
            yield good[order[first:last]]
