"""A form of an effect beside a hypothesis: what it leaves, and the best of its neighbours.

The linear parameters are fitted at every trial (variable projection); the nonlinear ones are
refined by a simplex.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.optimize import minimize, minimize_scalar

from motorctl.identify.diagnose.search.held_out_blocks import held_out_sse, solve
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.option_ranges import option_bounds
from motorctl.model import Effect, Spans

Array = NDArray[np.float64]

SIMPLEX_STEPS = 30
"""Steps of the simplex search (Nelder and Mead) over a form's options. More takes time, fewer
leaves options short of their best. Chosen by hand."""
LINE_STEPS = 12
"""Steps of the line search (Brent) over a single option, at most, once it is between two others.
More takes time, fewer leaves the option short of its best. Chosen by hand."""
FIRST_STEP = 0.5
"""First step of both searches, in the effect's own first steps of its options. Larger leaves the
form that was found by the scan, smaller takes more steps. Chosen by hand: half of one."""
OPTION_TOLERANCE = 3e-4
"""Accuracy of the options, in the effect's first steps. Larger leaves residual for other names,
smaller takes time. Chosen by hand."""
COST_TOLERANCE = 1e-6
"""Accuracy of the logarithm of the squared residual, at which the simplex ends. Larger ends in flat
valleys, smaller takes time. Chosen by hand."""
IMPOSSIBLE = 1e3
"""Cost of options outside their range: that of a residual exp(1000) times as large, which no
options have. Any other would do that is beyond what options can cost. Chosen by hand."""


@dataclass(frozen=True)
class Form:
    """A form of an effect, and what it leaves."""

    effect: Effect
    sse: float
    """Squared residuals of the fit to all rows."""
    held_out: float
    """Squared residuals of blocks that were left out."""
    others: tuple[Form, ...] = ()
    """Of a scan: the next best, where an effect's residual has many valleys."""


def measure(
    hypothesis: Hypothesis, effect: Effect, scan: bool = False, coarse: bool = False
) -> Form | None:
    """Fit an effect beside the hypothesis; None where it adds no column or nothing finite.

    scan and coarse are those of `Hypothesis.extended`.
    """
    problem = hypothesis.extended(effect, scan, coarse)
    if not np.all(np.isfinite(problem.gram)):
        return None
    count = problem.size - hypothesis.problem.size
    if effect.kind != "command" and not problem.gram[:, -1 - count : -1, -1 - count : -1].any():
        return None
    sse = solve(problem).sse
    held_out = float(held_out_sse(problem).sum())
    # where held-out rows gain more than the fitted ones, what is there already was badly held
    least = hypothesis.held_out * sse / max(hypothesis.solution.sse, 1e-300)
    return Form(effect, sse, max(held_out, least))


def by_simplex(
    hypothesis: Hypothesis,
    form: Form,
    spans: Spans,
    most_steps: int = SIMPLEX_STEPS,
    fixed: Collection[str] = (),
) -> Form:
    """Search around a form for the best nonlinear options; those that are fixed stay."""
    steps = {k: step for k, step in form.effect.steps(spans).items() if k not in fixed}
    if not steps or form.sse <= 0.0:  # a sine meets the very sine that was commanded
        return form
    names = list(steps)
    bounds = option_bounds(form.effect, names, spans)
    start = np.array([float(getattr(form.effect.options, name)) for name in names])
    scale = np.array([steps[name] for name in names])
    best = form

    def cost(place: Array) -> float:
        nonlocal best
        values = start + place * scale
        if any(not low <= value <= high for value, (low, high) in zip(values, bounds, strict=True)):
            return IMPOSSIBLE
        try:
            effect = form.effect.with_options(**dict(zip(names, map(float, values), strict=True)))
        except ValidationError:
            return IMPOSSIBLE
        found = measure(hypothesis, effect)
        if found is None:
            return IMPOSSIBLE
        if found.sse < best.sse:
            best = found
        return float(np.log(max(found.sse, 1e-300) / form.sse))

    n = len(names)
    if n == 1:
        minimize_scalar(
            lambda place: cost(np.array([place - 1.0])),
            bracket=(1.0, 1.0 + FIRST_STEP),
            method="brent",
            options={"xtol": OPTION_TOLERANCE, "maxiter": min(most_steps, LINE_STEPS)},
        )
        return best
    simplex = np.vstack([np.zeros(n), FIRST_STEP * np.eye(n)])
    minimize(
        cost,
        np.zeros(n),
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": most_steps * n,
            "xatol": OPTION_TOLERANCE,
            "fatol": COST_TOLERANCE,
        },
    )
    return best
