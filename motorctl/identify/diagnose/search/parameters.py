"""From the outcome of a search to parameters in the units of the command, with their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from motorctl.identify.columns.left_side import turned, turned_jacobian
from motorctl.identify.diagnose.search.held_out_blocks import BlockedFit, BlockedRegression, solve
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, held_columns
from motorctl.identify.diagnose.search.measured_forms import measure
from motorctl.model import Effect, EffectList, Spans

Array = NDArray[np.float64]

CURVATURE_STEP = 0.05
"""Step in which the residual's curvature over an option is measured, in the first steps of its
search. Larger leaves the parabola, smaller drowns in rounding. Chosen by hand."""

Compensation = tuple[Effect, BlockedRegression]
"""A spline for what has no name, and the regression with its columns last."""


@dataclass(frozen=True)
class FittedModel:
    """Parameters of a list, in units of the command."""

    model: EffectList
    theta: Array
    """(n,)"""
    std_error: Array


def values_of(hypothesis: Hypothesis, extra: Compensation | None = None) -> FittedModel:
    """Return the parameters of a hypothesis; measurement errors get their amplitudes as options.

    extra is one more state effect, and the problem with its columns last.
    """
    problem = hypothesis.problem if extra is None else extra[1]
    found = hypothesis.solution if extra is None else solve(problem)
    covariance = robust_covariance(problem, found)
    b = found.b
    if hypothesis.regressors.side == "command":
        jacobian = turned_jacobian(b)
        b, covariance = turned(b), jacobian @ covariance @ jacobian.T
    order = [*hypothesis.of_kind("input"), *hypothesis.of_kind("state")]
    start, columns = 1, {}
    for effect in order:
        columns[effect.name] = list(range(start, start + len(effect.parameters)))
        start += len(effect.parameters)
    corrected: dict[str, Effect] = {}
    for effect in hypothesis.of_kind("measurement"):
        size = len(effect.amplitudes)
        corrected[effect.name] = _with_amplitudes(effect, b[start : start + size])
        start += size
    rigid = hypothesis.regressors.side == "acceleration"
    for effect in hypothesis.of_kind("state"):
        if "resonance" in effect.groups and effect in hypothesis.added and rigid:
            own = columns[effect.name]
            corrected[effect.name], theta_ = effect.on_own_acceleration([-b[i] for i in own])
            b = b.copy()
            b[own] = [-value for value in theta_]
    added = tuple(corrected.get(effect.name, effect) for effect in hypothesis.added)
    if extra is not None:
        columns[extra[0].name] = list(range(start, start + len(extra[0].parameters)))
        added = (*added, extra[0])
    model = EffectList([*hypothesis.regressors.declared.effects, *added])
    theta: list[float] = []
    error: list[float] = []
    for effect in model.effects:
        if effect.proportional_to == "acceleration":
            theta.append(1.0 / b[0])
            error.append(math.sqrt(covariance[0, 0]) / b[0] ** 2)
            continue
        for column in columns.get(effect.name, []):
            if columns[effect.name].index(column) in held_columns(effect):
                theta.append(0.0)
                error.append(0.0)
                continue
            value = -b[column] / b[0]
            slope = np.zeros(len(b))
            slope[column], slope[0] = -1.0 / b[0], b[column] / b[0] ** 2
            theta.append(value)
            error.append(math.sqrt(max(float(slope @ covariance @ slope), 0.0)))
    return FittedModel(model, np.array(theta), np.array(error))


def robust_covariance(problem: BlockedRegression, found: BlockedFit) -> Array:
    """Return the covariance of b, at least as large as the blocks' scores say.

    Rows close in time are correlated where something is left unexplained: the sums of scores
    over blocks are what is independent.
    """
    rows = problem.columns.shape[0] * problem.columns.shape[2]
    p = problem.size
    classical = found.covariance * found.sse / max(rows - p, 1)
    X, y = problem.gram[:, :-1, :-1], problem.gram[:, :-1, -1]
    scores = y - X @ found.b
    blocks = len(scores)
    if blocks <= 2:
        return np.asarray(classical)
    middle = scores.T @ scores * blocks / (blocks - 1)
    robust = found.covariance @ middle @ found.covariance
    scale = np.sqrt(np.maximum(1.0, np.diag(robust) / np.maximum(np.diag(classical), 1e-300)))
    return np.asarray(classical * np.outer(scale, scale))


def option_errors(hypothesis: Hypothesis, effect: Effect, spans: Spans) -> dict[str, float]:
    """Return standard errors of the nonlinear options, from how the residual rises around them."""
    rest = hypothesis.without(effect.name)
    best = measure(rest, effect)
    if best is None:
        return {}
    variance = best.sse / max(hypothesis.regressors.signals.rows - hypothesis.problem.size, 1)
    errors = {}
    for name, step in effect.steps(spans).items():
        h = CURVATURE_STEP * step
        value = float(getattr(effect.options, name))
        rises = []
        for sign in (-1.0, 1.0):
            try:
                moved = measure(rest, effect.with_options(**{name: value + sign * h}))
            except ValidationError:
                continue
            if moved is not None:
                rises.append(moved.sse - best.sse)
        curvature = float(np.mean(rises)) * 2.0 / h**2 if rises else 0.0
        known = curvature > 0.0
        errors[name] = math.sqrt(2.0 * variance / curvature) if known else float(step)
    return errors


def theta_of(values: FittedModel, effect: Effect) -> tuple[Array, Array]:
    """Return the linear parameters of one effect of a model, and their errors."""
    start = 0
    for each in values.model.effects:
        count = len(each.parameters)
        if each.name == effect.name:
            return values.theta[start : start + count], values.std_error[start : start + count]
        start += count
    return np.zeros(0), np.zeros(0)


def column_index(hypothesis: Hypothesis, effects: Sequence[str]) -> list[int]:
    """Return the columns that belong to some effects."""
    return [i for i, name in enumerate(hypothesis.names) if name in effects]


def _with_amplitudes(effect: Effect, values: Array) -> Effect:
    try:
        return effect.with_options(**dict(zip(effect.amplitudes, map(float, values), strict=True)))
    except ValidationError:
        return effect
