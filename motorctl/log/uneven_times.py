"""Whether times that are not uniform are those of uneven samples, or of a clock read late."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

Array = NDArray[np.float64]
Ticks = NDArray[np.int64]

HOLE_STEPS = 5.0
"""A step longer than so many of those that nine tenths of the samples keep is a hole."""
SMOOTHER = 0.7
"""Where the motion is so much smoother over the count of its samples than over their times, or the
other way round, it tells which of the two is right."""
MOSTLY = 0.95
"""Where it does not tell, samples count as uniform if this part of the steps is one period."""
ONE_PERIOD = 0.25
"""How far a step may be from one period to count as one."""
RHYTHM = 0.3
"""Mean of the phases of the times, as vectors of length one, from which they count a period: 1 for
a clock without jitter, 0 for steps of any length. Larger misses clocks that are read very late,
smaller finds a period by chance. Arithmetic: jitter of 0.3 periods each way leaves 0.5, late by 0.2
on average 0.6; a thousand steps of any length 0.15."""
FIRST_SAMPLES = 64
"""Samples over which a period is told first; then over twice as many, each time. More asks a better
first guess, fewer take the jitter for a period. Arithmetic: a guess 0.3 % off is then 0.2 periods
off at the end."""
MOST_MISSING = 0.1
"""Missing samples over those that are there, up to which times count a period. Larger takes a clock
that alternates for one that skips, smaller misses recorders that skip often. Chosen by hand."""
MOVED_SAMPLES = 5
"""Samples by which a single hole may be in the wrong place. More takes time, fewer misses several
late samples in a row. Chosen by hand: of 8000 holes among stamps late by 0.1 to 0.2 periods on
average, one was hidden by four late samples, none by more."""
MUCH_NEARER = 0.5
"""How much smoother the motion is with a hole in another place, for the hole to be there. Larger
moves holes by noise, smaller leaves them where a late clock put them. Chosen by hand."""
FEWEST_SAMPLES = 5
"""Samples of which one is compared with a cubic through two on each side. Arithmetic."""
FURTHEST_PERIODS = 1.5
"""A clock that is read late lies at most so far off the uniform grid, drift apart."""


def longest_step(time_s: Array) -> float:
    """Return the longest step that is no hole [s]."""
    return HOLE_STEPS * float(np.percentile(np.diff(time_s), 90.0))


def usual_step(time_s: Array) -> float:
    """Return the time between neighbouring samples, holes apart [s].

    The period that they count, late or early, some missing; their mean step where they count none.
    """
    steps = np.diff(time_s)
    median = float(np.median(steps))
    near = np.abs(steps / median - 1.0) < ONE_PERIOD
    if np.mean(near) > MOSTLY:
        return float(np.mean(steps[near]))
    mean = float(np.mean(steps[steps <= longest_step(time_s)]))
    counted = (_counted_period(time_s, first) for first in (median, mean))
    return next((period for period in counted if period is not None), mean)


def _counted_period(time_s: Array, first_s: float) -> float | None:
    """Return the period that times count, near a first guess [s]; None where they count none."""
    since = time_s - time_s[0]
    period, length = first_s, FIRST_SAMPLES
    while True:
        part = since[:length]
        start = _phase(part / period)[1] * period
        ticks = np.rint((part - start) / period)
        if np.ptp(ticks) == 0.0:
            return None
        period = float(np.polynomial.Polynomial.fit(ticks, part, 1).deriv()(0.0))
        if period <= 0.0:
            return None
        if length >= len(since):
            break
        length *= 2
    rhythm, _ = _phase(since / period)
    missing = since[-1] / period - (len(since) - 1)
    return period if rhythm > RHYTHM and missing < MOST_MISSING * len(since) else None


def _phase(places: Array) -> tuple[float, float]:
    """Return how well places [periods] keep to whole periods, 0 to 1, and how far beyond one."""
    vector = complex(np.mean(np.exp(2j * np.pi * places)))
    return abs(vector), float(np.angle(vector)) / (2.0 * np.pi)


def counted_ticks(time_s: Array, period_s: float) -> Ticks:
    """Return which usual period each sample belongs to, from 0: no two share one.

    A clock that is read late is late for a sample or two; behind a hole all are.
    """
    count = np.arange(len(time_s))
    beyond = (time_s - time_s[0]) / period_s - count
    usual = _phase(beyond[:FIRST_SAMPLES])[1]
    holes = np.rint(isotonic_regression(beyond).x - usual).astype(np.int64)
    last = slice(-1 - MOVED_SAMPLES, None)
    if holes[-1] - holes[last][0] == 1:  # a hole that no more samples show is a late last one
        holes[last] = holes[last][0]
    return np.asarray(holes - holes[0] + count)


def is_even_by_index(ticks: Ticks, time_s: Array, period_s: float, motion: Sequence[Array]) -> bool:
    """Return whether motion is clearly smoother over the count of its samples than over its times.

    Parameters
    ----------
    ticks
        The count of periods, with what is missing, (N,).
    time_s
        The recorded times [s], (N,).
    period_s
        The usual time between neighbouring samples [s].
    motion
        Smooth columns, (N,) each, such as positions.

    Returns
    -------
    bool
        True where the times are those of a clock read late, and samples are uniform.
    """
    count = ticks.astype(np.float64)
    drift = np.polynomial.Polynomial.fit(count, time_s, 1)
    slope = float(drift.deriv()(0.0))
    if slope <= 0.0 or float(np.max(np.abs(time_s - drift(count)))) > FURTHEST_PERIODS * slope:
        return False
    even = sum(_roughness(count, values) for values in motion)
    uneven = sum(_roughness(time_s, values) for values in motion)
    if even < SMOOTHER * uneven or uneven < SMOOTHER * even:
        return even < uneven
    steps = np.diff(time_s) / period_s
    return float(np.mean(np.abs(steps - np.rint(steps)) < ONE_PERIOD)) > MOSTLY


def with_holes_in_place(ticks: Ticks, motion: Sequence[Array]) -> Ticks:
    """Return the ticks of samples, with single holes moved by some samples where motion says so.

    A sample that was stamped late by more than half a period, and is followed by a missing one, is
    taken for the later of the two, and so are those just before it.
    """
    moved = ticks.copy()
    edge = 2 + MOVED_SAMPLES
    for behind in np.flatnonzero(np.diff(ticks) == 2) + 1:
        window = slice(behind - edge, behind + edge)
        places = moved[window]
        if len(places) < 2 * edge or np.count_nonzero(np.diff(places) != 1) != 1:
            continue  # at an end, or another hole is near
        inside = np.arange(2 * edge)
        tried = [
            places - (inside >= edge) + (inside >= edge + later)
            for later in range(-MOVED_SAMPLES, MOVED_SAMPLES + 1)
        ]
        rough = [
            sum(_roughness(each.astype(np.float64), values[window]) for values in motion)
            for each in tried
        ]
        best = int(np.argmin(rough))
        if rough[best] < MUCH_NEARER * rough[MOVED_SAMPLES]:
            moved[window] = tried[best]
    return moved


def _roughness(places: Array, values: Array) -> float:
    """Return what a cubic through two samples on each side misses, over the range of the values."""
    finite = np.isfinite(values)
    x, y = places[finite], values[finite]
    if len(x) < FEWEST_SAMPLES:
        return 0.0
    # a damaged file may hold times and values whose products are no numbers: nothing is rougher
    with np.errstate(over="ignore", invalid="ignore"):
        span = float(np.ptp(y))
        missed = float(np.sqrt(np.mean(_missed(x, y) ** 2))) if span else 0.0
    if span == 0.0:
        return 0.0
    return missed / span if np.isfinite(missed) and np.isfinite(span) else np.inf


def _missed(x: Array, y: Array) -> Array:
    """Return what each sample is off the cubic through two on each side, (N - 4,)."""
    nodes = [x[k : len(x) - 4 + k] for k in (0, 1, 3, 4)]
    at = x[2:-2]
    predicted = np.zeros_like(at)
    for i, k in enumerate((0, 1, 3, 4)):
        weight = np.ones_like(at)
        for j, node in enumerate(nodes):
            if j != i:
                weight *= (at - node) / (nodes[i] - node)
        predicted += weight * y[k : len(y) - 4 + k]
    return np.asarray(y[2:-2] - predicted)
