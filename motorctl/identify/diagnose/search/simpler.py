"""The simpler of two effects that take nearly the same: what has more freedom has shown nothing."""

from __future__ import annotations

from collections.abc import Sequence

from motorctl.identify.columns.left_side import Side
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form
from motorctl.model import Effect, Spans

TIE: dict[Side, float] = {"acceleration": 0.0, "command": 0.02}
"""Part of what the best form takes of held-out rows that a simpler one may leave and still be
preferred, by the left side: machines that are not down to their noise have that much for any spare
parameter to draw. Larger gives a weight's name to springs, smaller gives a spline's or a wave's
name to weights. Chosen by hand on real arms and pendulums: 0.001 to 0.011; down to the noise a
held-out row decides."""

CLEARLY = 0.01
"""Part of the squared residual by which an exchange must lower it. Larger keeps first choices that
were wrong, smaller exchanges by chance. Chosen by hand."""


def freedom(effect: Effect, spans: Spans) -> int:
    """Return how many numbers of an effect are fitted: its parameters and its options.

    Those that it may lack count where it has them.
    """
    lacks = [name for name in effect.may_lack if getattr(effect.options, name) == 0.0]
    options = len(effect.steps(spans).keys() - lacks)
    return len(effect.parameters) + len(effect.amplitudes) + options


def simplest_first(hypothesis: Hypothesis, forms: Sequence[Form], spans: Spans) -> list[Form]:
    """Return forms, best first, with the simplest of those in front that take as much as the best.

    Parameters
    ----------
    hypothesis
        The model without any of them.
    forms
        Best first.
    spans
        What the recording spans.
    """
    if not forms:
        return []
    best = forms[0]
    tie = TIE[hypothesis.regressors.side] * max(hypothesis.held_out - best.held_out, 0.0)
    tied = [form for form in forms if form.held_out <= best.held_out + tie]
    first = min(tied, key=lambda form: freedom(form.effect, spans))
    return [first, *(form for form in forms if form is not first)]


def instead_of(rest: Hypothesis, old: Form, new: Form, spans: Spans) -> bool:
    """Return whether one effect should stand in the place of another that was taken before.

    Parameters
    ----------
    rest
        The model without either.
    old, new
        The one that stands there, and the one that came near.
    spans
        What the recording spans.
    """
    tie = TIE[rest.regressors.side] * max(rest.held_out - min(old.held_out, new.held_out), 0.0)
    if freedom(new.effect, spans) < freedom(old.effect, spans) and tie > 0.0:
        return new.held_out < old.held_out + tie
    richer = freedom(new.effect, spans) > freedom(old.effect, spans)
    return new.held_out < min(old.held_out * (1.0 - CLEARLY), old.held_out - tie * richer)
