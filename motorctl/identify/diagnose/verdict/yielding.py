"""Whether an axis yields before it slides, as a friction that bends first must.

Friction that is dry holds an axis to the last micrometre while the command sweeps from one side to
the other, and lets go at once. What bends first moves meanwhile, by its own displacement. So the
way that the axis makes while its friction rises is compared with the one that the effect would give
it. What the filters add to that way, where an axis turns round quickly, speaks for the effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.stretches import smoothed
from motorctl.identify.diagnose.search.hypothesis import PREDICTED_BAND, Hypothesis
from motorctl.identify.diagnose.search.search import Found, with_final
from motorctl.model import Effect, basic_effects

Array = NDArray[np.float64]

FROM, TO = 0.3, 0.85
"""Parts of the friction between which it is followed, in the direction in which it rises. Further
apart they reach into what noise does at rest or into sliding, closer together they leave no way to
measure. Chosen by hand."""
SEEN_HZ = 50.0
"""Band in which friction and position are followed [Hz]. Larger adds the noise of the acceleration,
smaller takes what comes after the breakaway for yielding. Chosen by hand."""
LONGEST_S = 0.5
"""Longest time of a rise [s]. Larger adds creep and drift, smaller misses slow controllers. Chosen
by hand."""
MOST_WAY = 6.5
"""Way of a rise, over that which the effect would give it, beyond which the axis was sliding.
Larger counts forces that vary in motion, smaller leaves out softer machines. Chosen by hand."""
FEWEST_RISES = 3
"""Slow rises from which it is judged. More judges few recordings, fewer judges by one event. Chosen
by hand."""
FASTEST_PART = 0.3
"""Part of the rows in motion, the fastest ones, in which an axis slides and its friction is steady.
Larger reaches into turning round, smaller leaves few rows. Chosen by hand."""
RESTS = 0.05
"""Speed, over the top speed, up to which an axis counts as at rest or turning round. Larger leaves
out slow motion, smaller takes what noise does at rest for sliding. Chosen by hand."""
MOST_SCATTER = 0.5 * (TO - FROM)
"""Scatter of the friction of an axis that slides, over Coulomb friction, up to which a rise is one
of friction. Larger counts rises of the command's or the acceleration's noise, in which no axis
moves; smaller leaves noisy recordings unjudged. Arithmetic: a rise is two standard deviations."""
YIELDS = 0.03
"""Way that the axis makes, over what the effect would give it, from which it yields. Larger refutes
effects where rises of the command's noise pass for those of friction, smaller keeps those of dry
friction. Chosen by hand: dry machines of other hands have -0.1 and 0.01, ones that yield 0.84 to
1.04, and one behind a coarse encoder 0.05."""


@dataclass(frozen=True)
class Yielding:
    """What an axis does while its friction rises."""

    rises: int
    way_m: float
    """The median way, in the direction in which friction rises."""
    expected_m: float
    """What the effect would give it."""


def without_rigid(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without effects that yield where the axis does not, and why."""
    notes = []
    for effect in found.final.added:
        if not effect.way_of_rise_m(FROM, TO) > 0.0:
            continue
        seen = yielding(found.final, effect)
        if seen is None or seen.way_m >= YIELDS * seen.expected_m:
            continue
        found = with_final(found, found.final.without(effect.name).refreshed())
        unit = found.final.regressors.signals.data.position_unit
        notes.append(
            f"{effect.name} is refuted: with it the axis would move by {seen.expected_m:.2g} "
            f"{unit} while friction rises from {100.0 * FROM:g} to {100.0 * TO:g} %; in "
            f"{seen.rises} rises it moves by {seen.way_m:.2g} {unit} (limit "
            f"{100.0 * YIELDS:g} % of that): it sticks, and lets go at once"
        )
    return found, tuple(notes)


def yielding(final: Hypothesis, effect: Effect) -> Yielding | None:
    """Return what the axis does in rises of its friction; None where too few are told from noise.

    Parameters
    ----------
    final
        A model that has the effect: without it inertia and friction may be far off.
    effect
        The one that yields.
    """
    frictions = list(_friction(final, effect))
    if _scatter(final, frictions) > MOST_SCATTER:
        return None
    ways = list(_ways(final, effect, frictions))
    if len(ways) < FEWEST_RISES:
        return None
    return Yielding(len(ways), float(np.median(ways)), effect.way_of_rise_m(FROM, TO))


def _scatter(final: Hypothesis, frictions: Sequence[Array]) -> float:
    """Return how far friction is from steady while the axis slides, over Coulomb friction."""
    speeds = [s.v for s, _ in zip(final.regressors.signals.stretches, frictions, strict=False)]
    if not speeds:
        return 0.0
    v, friction = np.concatenate(speeds), np.concatenate(frictions)
    speed = np.abs(v)
    moves = speed[speed > RESTS * speed.max()]
    if not len(moves):
        return 0.0
    slides = speed >= np.quantile(moves, 1.0 - FASTEST_PART)
    return float(np.std(np.sign(v[slides]) * friction[slides]))


def _ways(final: Hypothesis, effect: Effect, frictions: Sequence[Array]) -> Iterator[float]:
    signals = final.regressors.signals
    period_s, longest_m = signals.period_s, MOST_WAY * effect.way_of_rise_m(FROM, TO)
    for s, friction in zip(signals.stretches, frictions, strict=False):
        x = smoothed(s.position, SEEN_HZ, period_s)
        for side in (1.0, -1.0):
            for start, end in _rises(side * friction):
                way = side * float(x[end] - x[start])
                lasts_s = (end - start) * period_s
                if lasts_s <= LONGEST_S and abs(way) < longest_m:
                    yield way


def _rises(friction: Array) -> Iterator[tuple[int, int]]:
    """Yield where friction is at `FROM` for the last time before it reaches `TO`, and where."""
    low = np.flatnonzero(friction <= FROM)
    reached = np.flatnonzero((friction[1:] >= TO) & (friction[:-1] < TO)) + 1
    last = -1
    for end in reached:
        before = int(np.searchsorted(low, end)) - 1
        if before < 0 or low[before] <= last:
            continue  # it fell only a little in between
        last = int(end)
        yield int(low[before]), int(end)


def _friction(final: Hypothesis, effect: Effect) -> Iterator[Array]:
    """Yield the measured friction of each stretch, over Coulomb friction, (N,); none without it."""
    signals = final.regressors.signals
    direction = basic_effects()["direction"].name
    level = sum(float(b) for b, name in zip(final.b, final.names, strict=True) if name == direction)
    if not level < 0.0:
        return
    frictions = [e for e in final.of_kind("state") if e.name in (direction, effect.name)]
    places = [[i for i, name in enumerate(final.names) if name == e.name] for e in frictions]
    band_hz = PREDICTED_BAND * signals.band_hz
    for s, predicted in zip(signals.stretches, final.predicted_acceleration(), strict=True):
        modelled = sum(
            (final.b[own] @ s.columns(e) for e, own in zip(frictions, places, strict=True)),
            start=np.zeros_like(s.x),
        )
        left = np.gradient(s.v, signals.period_s) - predicted
        measured = left + smoothed(modelled, band_hz, signals.period_s)
        yield smoothed(measured / level, SEEN_HZ, signals.period_s)
