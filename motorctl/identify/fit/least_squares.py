"""Identification by least squares: the delay, the parameters within their bounds, their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.measured import Measured
from motorctl.identify.fit.delay import delay_sensitivity, estimate_delay
from motorctl.identify.fit.regression import Regression, Solution, regression, solve, solve_bounded
from motorctl.identify.fit.regression_data import RegressionData
from motorctl.identify.fit.result import Bound, FitEstimate
from motorctl.identify.fit.standard_errors import sandwich
from motorctl.model import EffectList

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LeastSquares:
    """The estimate, and the regression without bounds that it came from."""

    estimate: FitEstimate
    problem: Regression
    solution: Solution
    delay_at_end: bool
    """The best delay lies at an end of the range that was sought."""


def by_least_squares(columns: RegressionData, bandwidth_rows: int) -> LeastSquares:
    """Identify `columns.model`; a parameter that would leave its physical bounds is held there.

    Standard errors come from the delta method with a covariance that honours correlation over at
    least `bandwidth_rows`.
    """
    options = columns.options
    delay_s, at_end = options.input_delay_s, False
    if options.estimate_delay:
        found = estimate_delay(columns)
        delay_s, at_end = found.delay_s, found.at_end
    problem = regression(*columns.at(delay_s), columns.model, options.left)
    solution = solve(problem)
    theta = problem.theta(solution.b)
    fixed = np.zeros(len(theta), dtype=np.bool_)
    at_bound: dict[str, Bound] = {}
    lower, upper = physical_bounds(columns.model, columns.data)
    if not within(theta, lower, upper):
        bounded = solve_bounded(problem, theta, lower, upper)
        theta, fixed = bounded.theta, bounded.at_lower | bounded.at_upper
        for i in np.flatnonzero(fixed):
            name = columns.model.parameter_names[i]
            at_bound[name] = "lower" if bounded.at_lower[i] else "upper"
    covariance = _covariance(columns, problem, theta, fixed, delay_s, bandwidth_rows)
    return LeastSquares(
        FitEstimate(theta, delay_s, covariance, at_bound), problem, solution, at_end
    )


def physical_bounds(model: EffectList, data: Measured) -> tuple[Array, Array]:
    """Return the bounds of theta, (n,) each.

    The effects' bounds are numbers in volts and metres; in other units only their signs hold.
    """
    lower = np.array([p.lower for p in model.parameters])
    upper = np.array([p.upper for p in model.parameters])
    if (data.position_unit, data.command_unit) == ("m", "V"):
        return lower, upper
    return np.where(lower >= 0.0, 0.0, -np.inf), np.where(upper > 0.0, np.inf, 0.0)


def within(theta: Array, lower: Array, upper: Array) -> bool:
    """Return whether all of theta lies in its bounds."""
    return bool(np.all((theta >= lower) & (theta <= upper)))


def _covariance(
    columns: RegressionData,
    problem: Regression,
    theta: Array,
    fixed: NDArray[np.bool_],
    delay_s: float,
    bandwidth_rows: int,
) -> Array:
    """Return the covariance of (theta, delay), shape (n + 1, n + 1); zero where fixed."""
    b = problem.coefficients(theta)
    n = len(b)
    free = np.append(~fixed, columns.options.estimate_delay)
    J = np.zeros((len(problem.y), n + 1))
    J[:, :n] = problem.X @ np.linalg.inv(problem.jacobian(b))
    if columns.options.estimate_delay:
        J[:, n] = delay_sensitivity(columns, delay_s, theta, columns.options.left)
    residual = problem.y - problem.X @ b
    used = J[:, free]
    bread = solve(Regression(used, residual, None)).bread
    covariance = np.zeros((n + 1, n + 1))
    covariance[np.ix_(free, free)] = sandwich(bread, used * residual[:, None], bandwidth_rows)
    return covariance
