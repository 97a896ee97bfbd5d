"""What a motion can show: an effect whose columns the declared model mimics cannot be tested."""

from __future__ import annotations

import numpy as np

from motorctl.identify.columns.frame import Frame
from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.search.forms import with_slope
from motorctl.identify.diagnose.search.held_out_blocks import solve
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import Found
from motorctl.model import Effect, Spans, known_effects

UNEXPLAINED = 0.03
"""Least part of a column's length that the declared model leaves, for it to be testable."""
JUDGED = (
    "quadratic_drag",
    "asymmetric_friction",
    "position_force",
    "position_dependent_friction",
    "cogging",
    "force_ripple",
    "stribeck",
)
"""Effects without which a model is not called complete; the others need special occasions."""
TIED = 0.25
"""Part of the other axis' measured motion that may be its own noise and following error."""
TYPICAL = {"cogging": 12.0, "force_ripple": 12.0}
"""Pitches in the travel of a typical form."""


def untestable(found: Found, slope_s_m: float | None) -> dict[str, float]:
    """Give the effects that this motion cannot show, with the part of them that is left."""
    hypothesis = found.base
    present = {e.name for e in (*hypothesis.bench.declared.effects, *found.final.added)}
    hidden = {}
    for name in JUDGED:
        if name in present:
            continue
        form = _typical(known_effects()[name], found.spans)
        if form is None:
            hidden[name] = 0.0
            continue
        part = unexplained(hypothesis, with_slope(form, slope_s_m))
        if part < UNEXPLAINED:
            hidden[name] = part
    return hidden


def unexplained(hypothesis: Hypothesis, effect: Effect) -> float:
    """Give the part of an effect's columns that the hypothesis' columns do not explain, 0 to 1."""
    problem = hypothesis.extended(effect)
    n, total = hypothesis.problem.size, problem.gram.sum(axis=0)
    parts = []
    for column in range(n, problem.size):
        own = total[column, column]
        if own <= 0.0:
            continue
        order = [*range(n), column]
        gram = problem.gram[:, order][:, :, order]
        soft = problem.soft[:n]
        left = solve(type(problem)(problem.blocks, problem.columns[:, order], gram, soft)).sse
        parts.append(float(np.sqrt(max(left, 0.0) / own)))
    return max(parts, default=0.0)


def coupled_motion(data: Measured, frame: Frame) -> set[str]:
    """Give the effects that the reference's own motion ties to the declared ones.

    Of axes that move in step one cannot tell the other's inertia from one's own. On measured
    data this does not show: what the feedback adds unties them only seemingly.
    """
    if data.reference is None or not np.all(np.isfinite(data.reference[data.usable])):
        return set()
    tied = True
    for stretch in frame.stretches:
        first = int(np.searchsorted(data.time_s, stretch.time_s[0] - 0.5 * frame.period_s))
        reference = data.reference[first : first + len(stretch.x)]
        if len(reference) < len(stretch.x):
            return set()
        v = np.gradient(reference, frame.period_s)
        own = np.stack([np.gradient(v, frame.period_s), v, np.sign(v), np.ones_like(v)])
        own = own[:, :: frame.decimation]
        for beside in stretch.others.values():
            for column in (beside[:: frame.decimation, 2], beside[:: frame.decimation, 1]):
                smooth = column - column.mean()
                b = np.linalg.lstsq(own.T, smooth, rcond=None)[0]
                left = float(np.linalg.norm(smooth - b @ own))
                left /= max(float(np.linalg.norm(smooth)), 1e-300)
                tied = tied and left < TIED
    return {"cross_axis"} if tied else set()


def _typical(cls: type[Effect], spans: Spans) -> Effect | None:
    if cls.name in TYPICAL:
        pitch = spans.travel_m / TYPICAL[cls.name]
        return cls(cls.Options.model_validate({"pitch_m": pitch}))
    forms = list(cls.trials(spans))
    return forms[len(forms) // 2] if forms else None
