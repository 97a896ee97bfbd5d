"""Friction of another shape than declared: alone, or beside an effect that the wrong shape hid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from motorctl.identify.diagnose.search.acceptance import AS_WELL, acceptable, gain
from motorctl.identify.diagnose.search.declared_shape import EXTREMES, reshaped, with_best_slope
from motorctl.identify.diagnose.search.forms import NEAR, is_corner
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form
from motorctl.identify.diagnose.search.physics import beyond_physics
from motorctl.identify.diagnose.search.settling import settled
from motorctl.model import Spans

MENDED_FIRST = 0.9
"""Part of the best effect's gain from which the declared friction's own width is fitted anew
instead of adding anything. Larger names effects for a width that was declared wrong, smaller widens
friction where an effect is missing. Chosen by hand."""
MUCH_MORE = 0.7
"""Part of the squared residual of another shape of friction alone that the shape with an effect of
friction leaves at most to be taken instead. Larger names effects for what a shape cannot mimic
exactly, smaller hides them in the shape. Chosen by hand."""
FRICTIONS = 4
"""Effects of friction that are tried beside another shape of it, at most. More takes time, fewer
misses the right one where the wrong shape hides it. Chosen by hand."""
TURNS = 2
"""Times that an effect and a shape of friction are fitted one after the other. More takes time,
fewer leave both bent to each other. Chosen by hand on a stage with Stribeck's friction."""


@dataclass(frozen=True)
class Mended:
    """A hypothesis with friction of its best shape."""

    whole: Hypothesis
    shape: Hypothesis
    """With the shape alone."""
    tried: tuple[Form, ...] = ()
    """Effects of friction beside it, best first."""
    taken: Form | None = None
    """The one that is in `whole`."""


def mended(
    hypothesis: Hypothesis, forms: Sequence[Form], noise: float, spans: Spans, least: float
) -> Mended | None:
    """Return the hypothesis with friction of its best shape, where that gains enough.

    It is asked where an effect of friction leads: a shape that was declared wrong looks like one of
    them, and they like another shape. So each that comes near is tried beside the shape as well,
    and the best is taken where the shape alone, or the effect beside the declared shape, leaves
    much more. An effect that explains no more than the corner of any friction is no rival.
    """
    best = gain(hypothesis, forms[0].held_out) if forms else 0.0
    frictions = [
        form
        for form in forms
        if "friction" in form.effect.groups
        and gain(hypothesis, form.held_out) > max(least, best / NEAR)
    ][:FRICTIONS]
    if not frictions or gain(hypothesis, frictions[0].held_out) < MENDED_FIRST * best:
        return None
    alone = reshaped(hypothesis, spans)
    if alone is None:
        return None
    alone = settled(alone, spans)
    tried = [reshaped(hypothesis.plus(form.effect), spans, quick=True) for form in frictions]
    trials = [trial for trial in tried if trial is not None]
    both = min(trials, key=lambda h: h.held_out, default=None)
    both = None if both is None else _fitted_in_turn(both, spans)
    if both is not None:
        much = MUCH_MORE * min(alone.held_out, frictions[0].held_out)
        beside = Form(both.added[-1], both.solution.sse, both.held_out)
        fits = both.held_out < much and acceptable(alone, beside, noise, spans, least)
        if fits and beyond_physics(both) is None:
            others = [Form(t.added[-1], t.solution.sse, t.held_out) for t in trials]
            return Mended(both, alone, tuple(sorted(others, key=lambda f: f.held_out)), beside)
    rivals = (form for form in forms if not is_corner(hypothesis, form))
    rival = next(rivals, None)
    best = 0.0 if rival is None else gain(hypothesis, rival.held_out)
    enough = max(least, MENDED_FIRST * best)
    return Mended(alone, alone) if gain(hypothesis, alone.held_out) >= enough else None


def _fitted_in_turn(both: Hypothesis, spans: Spans) -> Hypothesis | None:
    """Return an effect beside friction's shape, each fitted anew after the other, or None.

    From the best shape, and from each of those that differ most: the effect was fitted beside the
    shape that was declared, and bent itself to what that leaves.
    """
    reached = [reshaped(both, spans)]
    for shape in EXTREMES:
        each = both
        for _ in range(TURNS):
            each = settled(with_best_slope(each, shape, spans), spans)
        reached.append(reshaped(each, spans))
    found = [settled(each, spans) for each in reached if each is not None]
    return min(found, key=lambda h: h.held_out, default=None)


def without_unneeded(hypothesis: Hypothesis, spans: Spans) -> Hypothesis:
    """Drop effects of friction that a shape fitted without them makes superfluous."""
    for effect in hypothesis.added:
        if "friction" not in effect.groups:
            continue
        rest = reshaped(settled(hypothesis.without(effect.name), spans), spans)
        if rest is None:
            continue
        rest = settled(rest, spans)
        if rest.held_out < AS_WELL * hypothesis.held_out:
            hypothesis = rest
    return hypothesis
