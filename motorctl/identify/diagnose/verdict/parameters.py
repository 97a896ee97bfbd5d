"""From the outcome of a search to parameters in the units of the command, with their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from motorctl.identify.diagnose.search.forms import measure
from motorctl.identify.diagnose.search.held_out_blocks import Problem, Solution, solve
from motorctl.identify.diagnose.search.hypothesis import RESONANT, Hypothesis, acceleration_form
from motorctl.identify.fit.settings import Side
from motorctl.model import Effect, EffectList, Spans

Array = NDArray[np.float64]

CURVATURE_STEP = 0.05
"""Of the first step of an option's search."""


@dataclass(frozen=True)
class Values:
    """Parameters of a list, in units of the command."""

    model: EffectList
    theta: Array
    """(n,)"""
    std_error: Array


def values_of(hypothesis: Hypothesis, extra: tuple[Effect, Problem, int] | None = None) -> Values:
    """Give the parameters of a hypothesis; measurement errors get their amplitudes as options.

    extra is one more state effect, the problem with its columns last, and how many they are.
    """
    problem = hypothesis.problem if extra is None else extra[1]
    found = hypothesis.solution if extra is None else solve(problem)
    covariance = robust_covariance(problem, found)
    b, covariance = _turned(found.b, covariance, hypothesis.bench.side)
    order = [*hypothesis.of_kind("input"), *hypothesis.of_kind("state")]
    start, columns = 1, {}
    for effect in order:
        columns[effect.name] = list(range(start, start + len(effect.parameters)))
        start += len(effect.parameters)
    corrected: dict[str, Effect] = {}
    for effect in hypothesis.of_kind("measurement"):
        corrected[effect.name] = _with_amplitudes(effect, float(b[start]), float(b[start + 1]))
        start += 2
    rigid = hypothesis.bench.side == "acceleration"
    for effect in hypothesis.of_kind("state"):
        if effect.name in RESONANT and effect in hypothesis.added and rigid:
            column = columns[effect.name][0]
            corrected[effect.name], b = _as_mode(effect, b, column)
    added = tuple(corrected.get(effect.name, effect) for effect in hypothesis.added)
    if extra is not None:
        columns[extra[0].name] = list(range(start, start + extra[2]))
        added = (*added, extra[0])
    model = EffectList([*hypothesis.bench.declared.effects, *added])
    theta: list[float] = []
    error: list[float] = []
    for effect in model.effects:
        if effect.name == "inertia":
            theta.append(1.0 / b[0])
            error.append(math.sqrt(covariance[0, 0]) / b[0] ** 2)
            continue
        for column in columns.get(effect.name, []):
            value = -b[column] / b[0]
            slope = np.zeros(len(b))
            slope[column], slope[0] = -1.0 / b[0], b[column] / b[0] ** 2
            theta.append(value)
            error.append(math.sqrt(max(float(slope @ covariance @ slope), 0.0)))
    return Values(model, np.array(theta), np.array(error))


def _turned(b: Array, covariance: Array, side: Side) -> tuple[Array, Array]:
    """Give coefficients and covariance with the acceleration on the left."""
    if side == "acceleration":
        return b, covariance
    jacobian = -np.eye(len(b)) / b[0]
    jacobian[:, 0] = b / b[0] ** 2
    jacobian[0] = 0.0
    jacobian[0, 0] = -1.0 / b[0] ** 2
    return acceleration_form(b, side), np.asarray(jacobian @ covariance @ jacobian.T)


def robust_covariance(problem: Problem, found: Solution) -> Array:
    """Give the covariance of b, at least as large as the blocks' scores say.

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
    """Give standard errors of the nonlinear options, from how the residual rises around them."""
    rest = hypothesis.without(effect.name)
    best = measure(rest, effect)
    if best is None:
        return {}
    variance = best.sse / max(hypothesis.bench.frame.rows - hypothesis.problem.size, 1)
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


def theta_of(values: Values, effect: Effect) -> tuple[Array, Array]:
    """Give the linear parameters of one effect of a model, and their errors."""
    start = 0
    for each in values.model.effects:
        count = len(each.parameters)
        if each.name == effect.name:
            return values.theta[start : start + count], values.std_error[start : start + count]
        start += count
    return np.zeros(0), np.zeros(0)


def column_index(hypothesis: Hypothesis, effects: Sequence[str]) -> list[int]:
    """Give the columns that belong to some effects."""
    return [i for i, name in enumerate(hypothesis.names) if name in effects]


def _as_mode(effect: Effect, b: Array, column: int) -> tuple[Effect, Array]:
    """Turn a mode that was fitted on the rigid machine's acceleration r into the mode itself.

    a = r/(1 - f G) = r + f/(1 - f) G' r, where G' has its frequency and damping 1/sqrt(1 - f)
    times those of G = s^2/(s^2 + 2 zeta omega s + omega^2).
    """
    share = -float(b[column])
    f = share / (1.0 + share) if share > -0.9 else 0.0
    f = min(max(f, -0.9), 0.9)
    options = effect.options.model_dump()
    narrower = math.sqrt(1.0 - f)
    mode = effect.with_options(
        frequency_hz=options["frequency_hz"] * narrower,
        damping_ratio=options["damping_ratio"] * narrower,
    )
    turned = b.copy()
    turned[column] = -f
    return mode, turned


def _with_amplitudes(effect: Effect, sine: float, cosine: float) -> Effect:
    try:
        return effect.with_options(sin_m=sine, cos_m=cosine)
    except ValidationError:
        return effect
