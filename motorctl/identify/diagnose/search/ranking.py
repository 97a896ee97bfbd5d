"""The best form of every effect beside a hypothesis, best first."""

from __future__ import annotations

from motorctl.identify.diagnose.search.acceptance import LEAST_GAIN, gain
from motorctl.identify.diagnose.search.forms import NEAR, all_lines, best_form, refined
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form, measure
from motorctl.identify.diagnose.search.simpler import simplest_first
from motorctl.model import Effect, Spans
from motorctl.model.sign_function import Sign

REFINED = 5
"""Forms that are looked at for refining in each round: the best by the scan, and those that come
near. More takes time, fewer may miss one whose scan was coarse. Chosen by hand."""
PARTLY_SEEN = 2.0
"""Factor on `NEAR` for effects of which a scan shows only a part. Larger takes time, smaller misses
them. Chosen by hand."""


def ranked(
    hypothesis: Hypothesis, classes: list[type[Effect]], spans: Spans, sign: Sign | None
) -> list[Form]:
    """Return the best form of every effect, best first; those in front refined."""
    scanned = [best_form(hypothesis, cls, spans, sign) for cls in classes]
    forms = sorted((f for f in scanned if f is not None), key=lambda f: f.held_out)
    if not forms:
        return []
    best = gain(hypothesis, forms[0].held_out)
    front = [0]
    for k, form in enumerate(forms[1:], 1):
        waves, partly = "wave_over_position" in form.effect.groups, form.effect.scan_shows_part
        if partly and _shown_of_rare_events(hypothesis, form) > max(best, LEAST_GAIN) / NEAR:
            front.append(k)
            continue
        if best <= LEAST_GAIN / 2.0 or (k >= REFINED and not waves):
            continue
        near = NEAR * (PARTLY_SEEN if partly else 1.0)
        shown = gain(hypothesis, form.held_out)
        if shown <= best / near and waves:
            shown = gain(hypothesis, all_lines(hypothesis, type(form.effect), spans))
        if shown > best / near:
            front.append(k)
    improved = [refined(hypothesis, forms[k], spans) for k in front]
    rest = [form for k, form in enumerate(forms) if k not in front]
    by_error = sorted([*improved, *rest], key=lambda f: f.held_out)
    by_error = _beside_ringing(hypothesis, by_error, classes, spans)
    return simplest_first(hypothesis, by_error, spans)


def _beside_ringing(
    hypothesis: Hypothesis, forms: list[Form], classes: list[type[Effect]], spans: Spans
) -> list[Form]:
    """Return forms, best first, with what rings at the line of a wave over time that leads.

    A part that swings by itself looks like a force from outside of that frequency.
    """
    first = forms[0].effect
    if "wave_over_time" not in first.groups:
        return forms
    for cls in classes:
        tried = [
            measure(hypothesis, effect)
            for line in first.lines
            for effect in cls.ringing_at(line, spans)
        ]
        best = min((f for f in tried if f is not None), key=lambda f: f.sse, default=None)
        if best is not None:
            found = refined(hypothesis, best, spans)
            own = [f for f in forms if type(f.effect) is cls]
            if all(found.held_out < f.held_out for f in own):
                forms = [found, *(f for f in forms if type(f.effect) is not cls)]
    return sorted(forms, key=lambda f: f.held_out)


def _shown_of_rare_events(hypothesis: Hypothesis, form: Form) -> float:
    """Return the gain of a form on the rows that it is fitted to.

    A rough form may fit a rare event well, and yet say nothing of the next.
    """
    left = form.sse / max(hypothesis.solution.sse, 1e-300)
    return gain(hypothesis, hypothesis.held_out * left)
