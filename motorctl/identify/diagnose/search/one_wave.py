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
from motorctl.identify.diagnose.search.forms import (
    MOST_ORDER,
    SAME_LINE,
    Form,
    by_simplex,
    measure,
    pruned,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.simpler import freedom
from motorctl.model import Effect, Spans
from motorctl.model.pitch import HIGHEST_ORDER, PitchOptions


def one_wave(hypothesis: Hypothesis, spans: Spans) -> Hypothesis | None:
    """Return the hypothesis with one wave in the place of two that share its lines, or None.

    Where the one leaves no more on held-out rows than both, and has not more to be fitted.

    Parameters
    ----------
    hypothesis
        The declared model and what was found.
    spans
        What the recording spans.
    """
    waves = [effect for effect in hypothesis.added if effect.groups & OVER_PLACE and effect.lines]
    for pair in itertools.combinations(waves, 2):
        rest = hypothesis.without(pair[0].name).without(pair[1].name)
        forms = [_all_orders(rest, one, pair, spans) for one in pair]
        best = min(filter(None, forms), key=lambda form: form.held_out, default=None)
        if best is None or best.held_out > AS_WELL * hypothesis.held_out:
            continue
        if freedom(best.effect, spans) <= sum(freedom(effect, spans) for effect in pair):
            return rest.plus(best.effect)
    return None


def _all_orders(
    rest: Hypothesis, wave: Effect, pair: Sequence[Effect], spans: Spans
) -> Form | None:
    """Return a wave with the lines of both as its orders, None where they are none."""
    if not isinstance(wave.options, PitchOptions):
        return None
    tolerance = SAME_LINE / spans.travel_m
    lines = [line for effect in pair for line in effect.lines]
    for parts in range(1, MOST_ORDER + 1):
        base = 1.0 / (parts * wave.options.pitch_m)
        orders = {round(line / base) for line in lines}
        fits = all(abs(line - round(line / base) * base) < tolerance for line in lines)
        if fits and min(orders) >= 1 and max(orders) <= HIGHEST_ORDER:
            whole = wave.with_options(pitch_m=1.0 / base, orders=tuple(sorted(orders)))
            form = measure(rest, whole)
            return None if form is None else pruned(rest, by_simplex(rest, form, spans))
    return None
