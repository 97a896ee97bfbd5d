"""What a motion can show: an effect whose columns the declared model mimics cannot be tested."""

from __future__ import annotations

import numpy as np

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.held_out_blocks import solve
from motorctl.identify.diagnose.search.hypothesis import Catalogue, Hypothesis
from motorctl.identify.diagnose.search.search import Found
from motorctl.model import Effect
from motorctl.model.sign_function import Sign, with_sign

UNEXPLAINED = 0.03
"""Least part of a column's length that the declared model leaves, for it to be testable. Larger
calls testable effects hidden, smaller calls hidden ones tested. Chosen by hand."""
TIED = 0.25
"""Part of the other axis' measured motion that may be its own noise and following error and still
follow this one. Larger calls free axes tied, smaller misses tied ones. Chosen by hand."""


def ordinary(catalogue: Catalogue) -> tuple[type[Effect], ...]:
    """Return the effects without which no model is called complete; others need occasions."""
    return tuple(cls for cls in catalogue.values() if cls.ordinary)


def untestable(found: Found, sign: Sign | None) -> dict[str, float]:
    """Return the effects that this motion cannot show, with the part of them that is left."""
    hypothesis = found.base
    present = {e.name for e in (*hypothesis.regressors.declared.effects, *found.final.added)}
    hidden = {}
    for cls in ordinary(hypothesis.regressors.catalogue):
        if cls.name in present:
            continue
        form = cls.typical(found.spans)
        if form is None:
            hidden[cls.name] = 0.0
            continue
        part = unexplained(hypothesis, with_sign(form, sign))
        if part < UNEXPLAINED:
            hidden[cls.name] = part
    return hidden


def unexplained(hypothesis: Hypothesis, effect: Effect) -> float:
    """Return the part of an effect's columns that the hypothesis' do not explain, 0 to 1."""
    problem = hypothesis.extended(effect)
    n, total = hypothesis.problem.size, problem.gram.sum(axis=0)
    parts = []
    for column in range(n, problem.size):
        own = total[column, column]
        if own <= 0.0:
            continue
        order = [*range(n), column]
        gram = problem.gram[:, order][:, :, order]
        columns, free = problem.columns[:, order], (problem.soft[:n], problem.tied[:n])
        left = solve(type(problem)(problem.blocks, (columns,), gram, *free)).sse
        parts.append(float(np.sqrt(max(left, 0.0) / own)))
    return max(parts, default=0.0)


def tested_apart(catalogue: Catalogue, data: Measured, signals: Signals) -> Catalogue:
    """Return the effects that may be tried: none of coupling where all axes move in step."""
    if not _in_step(data, signals):
        return catalogue
    return {name: cls for name, cls in catalogue.items() if "coupling" not in cls.groups}


def _in_step(data: Measured, signals: Signals) -> bool:
    """Return whether the reference's own motion is that of every other axis.

    Of axes that move in step one cannot tell the other's inertia from one's own. On measured
    data this does not show: what the feedback adds unties them only seemingly.
    """
    if data.reference is None or not np.all(np.isfinite(data.reference[data.usable])):
        return False
    tied = True
    for stretch in signals.stretches:
        first = int(np.searchsorted(data.time_s, stretch.time_s[0] - 0.5 * signals.period_s))
        reference = data.reference[first : first + len(stretch.x)]
        if len(reference) < len(stretch.x):
            return False
        v = np.gradient(reference, signals.period_s)
        own = np.stack([np.gradient(v, signals.period_s), v, np.sign(v), np.ones_like(v)])
        own = own[:, :: signals.decimation]
        for beside in stretch.others.values():
            for column in (beside[:: signals.decimation, 2], beside[:: signals.decimation, 1]):
                smooth = column - column.mean()
                b = np.linalg.lstsq(own.T, smooth, rcond=None)[0]
                left = float(np.linalg.norm(smooth - b @ own))
                left /= max(float(np.linalg.norm(smooth)), 1e-300)
                tied = tied and left < TIED
    return tied
