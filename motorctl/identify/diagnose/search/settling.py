"""Options of effects that were found one after the other, refined once they stand together."""

from __future__ import annotations

from motorctl.identify.diagnose.search.forms import finer
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form, by_simplex
from motorctl.model import Effect, Spans
from motorctl.model.columns import uses_acceleration

SETTLING_STEPS = 14
"""Steps of the simplex search when options settle among other effects. More takes time, fewer
leaves options where they were before the others came. Chosen by hand."""


def settled(hypothesis: Hypothesis, spans: Spans) -> Hypothesis:
    """Refine the nonlinear options of all added effects in turn, the others being fitted too."""
    for _ in range(2 if any(map(acts_on_acceleration, hypothesis.added)) else 1):
        for effect in hypothesis.added:
            rest = hypothesis.without(effect.name)
            form = Form(effect, hypothesis.solution.sse, hypothesis.held_out)
            better = finer(rest, by_simplex(rest, form, spans, SETTLING_STEPS), spans)
            hypothesis = hypothesis.exchanged(better.effect)
        hypothesis = hypothesis.refreshed()
    return hypothesis


def acts_on_acceleration(effect: Effect) -> bool:
    """Return whether an effect's force depends on the acceleration, as a load's does."""
    return effect.kind == "state" and uses_acceleration(effect)
