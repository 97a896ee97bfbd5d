"""An effect of friction beside the declared friction, asked where the noise is known best.

As long as much is left, the rows are weighted by a noise that is taken for larger than it is, and
another shape of the declared friction then seems to do as well as an effect beside it. So both are
compared with the rows weighted as the effect leaves them. Where it leaves noise alone, and no shape
of the declared friction does, it is no remainder of a wrong shape, however small it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from motorctl.identify.diagnose.search.acceptance import NOISE_LIKE, gain
from motorctl.identify.diagnose.search.declared_shape import reshaped
from motorctl.identify.diagnose.search.forms import Form, is_corner, measure
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.mending import MENDED_FIRST, MUCH_MORE
from motorctl.identify.diagnose.search.option_ranges import at_bound
from motorctl.identify.diagnose.search.physics import beyond_physics
from motorctl.identify.diagnose.search.settling import settled
from motorctl.model import Effect, Spans

TRIED = 2
"""Effects of friction that are tried, at most. More takes time, fewer misses the right one where
much else is left. Chosen by hand."""

Whiten = Callable[[tuple[Effect, ...]], tuple[Regressors, float]]
"""Regressors whose rows have nearly white noise beside some effects, and the noise's density."""


def plain_friction(
    hypothesis: Hypothesis, forms: Sequence[Form], least: float, spans: Spans, whiten: Whiten
) -> Form | None:
    """Return the leading effect of friction where it leaves noise and no other shape does.

    Parameters
    ----------
    hypothesis
        The model without it, with friction of the declared shape.
    forms
        What was tried beside it, best first.
    least
        Gain in log-likelihood that a name needs.
    spans
        What the recording spans.
    whiten
        How rows are weighted beside some effects.

    Returns
    -------
    Form or None
        As it is fitted with the rows so weighted.
    """
    best = gain(hypothesis, forms[0].held_out) if forms else 0.0
    frictions = [
        form
        for form in forms
        if "friction" in form.effect.groups and gain(hypothesis, form.held_out) > least
    ]
    if not frictions or gain(hypothesis, frictions[0].held_out) < MENDED_FIRST * best:
        return None
    for form in frictions[:TRIED]:
        effect = _sure(hypothesis, form.effect, spans, whiten)
        found = None if effect is None else measure(hypothesis, effect)
        if found is not None:
            return found
    return None


def _sure(hypothesis: Hypothesis, effect: Effect, spans: Spans, whiten: Whiten) -> Effect | None:
    added = (*hypothesis.added, effect)
    regressors, noise = whiten(added)
    both = settled(Hypothesis(regressors, added).refreshed(), spans)
    newest = both.added[-1]
    if both.held_out > NOISE_LIKE * both.noise_sse(noise) or at_bound(newest, spans):
        return None
    rest = both.without(newest.name).refreshed()
    if beyond_physics(both) is not None:
        return None
    if is_corner(rest, Form(newest, both.solution.sse, both.held_out)):
        return None
    shaped = reshaped(rest, spans)
    if shaped is None:
        return None
    left = min(rest.held_out, settled(shaped, spans).held_out)
    return newest if both.held_out < MUCH_MORE * left else None
