"""One wave with all orders, where a search found its orders as several effects over the travel.

The search takes one effect after the other, and the strongest line first. The third order of a
magnet's pitch is a wave of a third of the pitch as well; where an error of the encoder describes
that line alone a little better, the magnet's other orders come after it as a second effect, and
what both leave as a third.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from motorctl.identify.diagnose.search.acceptance import AS_WELL, OVER_PLACE
from motorctl.identify.diagnose.search.forms import MOST_ORDER, SAME_LINE, fundamental, pruned
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import by_simplex, measure
from motorctl.identify.diagnose.search.option_ranges import LONGEST_PITCH
from motorctl.identify.diagnose.search.simpler import freedom
from motorctl.model import Effect, Spans
from motorctl.model.pitch import HIGHEST_ORDER, PitchOptions

LEAVES = 0.5
"""Part of what the weaker of two waves takes beside the other, that one in the place of both may
leave. Larger deletes a weak second cause, smaller keeps shadows of the first. Chosen by hand: where
there was one cause, one wave left less than the two; where there were two, all of it."""

CHANCE = 4.0
"""Orders of a pitch have to lie so many times further apart than a line may be off. Larger misses
orders of long pitches, smaller takes any two waves for orders of a pitch. Arithmetic: a line by
chance is one of the orders in half of all cases."""


def one_wave(hypothesis: Hypothesis, spans: Spans) -> Hypothesis | None:
    """Return the hypothesis with one wave in the place of two of one pitch, or None.

    Where the one leaves hardly more on held-out rows than both, and has not more to be fitted.

    Parameters
    ----------
    hypothesis
        The declared model and what was found.
    spans
        What the recording spans.
    """
    waves = [effect for effect in hypothesis.added if effect.groups & OVER_PLACE and effect.lines]
    for one, other in itertools.combinations(waves, 2):
        rest = hypothesis.without(one.name).without(other.name)
        joined = [_all_orders(rest, wave, (one, other), spans) for wave in (one, other)]
        models = [rest.plus(effect) for effect in joined if effect is not None]
        best = min(models, key=lambda model: model.held_out, default=None)
        if best is None or best.held_out > AS_WELL * hypothesis.held_out:
            continue
        weaker = min(hypothesis.without(wave.name).held_out for wave in (one, other))
        lost = best.held_out - hypothesis.held_out
        richer = freedom(best.added[-1], spans) > freedom(one, spans) + freedom(other, spans)
        if not richer and lost < LEAVES * (weaker - hypothesis.held_out):
            return best
    return None


def _own_lines(wave: Effect) -> Sequence[float]:
    """Return the lines of a wave's own columns: what is measured shows multiples of them, too."""
    if "wave_of_measurement" in wave.groups:
        return wave.lines[: max(len(wave.amplitudes) // 2, 1)]
    return wave.lines


def _all_orders(
    rest: Hypothesis, wave: Effect, pair: Sequence[Effect], spans: Spans
) -> Effect | None:
    """Return a wave with the lines of both as its orders, None where they are none."""
    if not isinstance(wave.options, PitchOptions):
        return None
    tolerance = SAME_LINE / spans.travel_m
    lines = [line for effect in pair for line in _own_lines(effect)]
    for parts in range(1, MOST_ORDER + 1):
        base = 1.0 / (parts * wave.options.pitch_m)
        if base * LONGEST_PITCH * spans.travel_m < 1.0 or base < CHANCE * tolerance:
            break
        orders = {round(line / base) for line in lines}
        if min(orders) < 1 or any(abs(e - round(e / base) * base) >= tolerance for e in lines):
            continue
        told = tuple(sorted(order for order in orders if order <= HIGHEST_ORDER))
        form = measure(rest, wave.with_options(pitch_m=1.0 / base, orders=told)) if told else None
        if form is not None:
            found = fundamental(rest, pruned(rest, by_simplex(rest, form, spans)), spans)
            return found.effect
    return None
