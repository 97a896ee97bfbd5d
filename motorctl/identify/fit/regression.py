"""Linear least squares of the declared model, with either side on the left (see `left_side`).

The command is known exactly, the acceleration carries the noise, so with the acceleration on the
left there is no bias. The parameters' covariance comes by the delta method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motorctl.identify.columns.left_side import Side, turned, turned_jacobian
from motorctl.model import EffectList

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SMALLEST_SINGULAR_VALUE = 1e-9
"""Singular value of the normalised columns, relative to the largest, below which a direction is not
determined by the data. Larger gives up what weak motion still tells, smaller takes rounding for a
value. Chosen by hand: far above a double's rounding, 2e-16."""
ON_BOUND = 1e-6
"""Distance from a bound, relative to the parameter's size, within which it stands on it: an
interior method stops just short. Larger holds true values at bounds, smaller lets a value a hair
inside pass for a free one. Chosen by hand."""
LEAST_SIZE = 1e-6
"""Size of a parameter at least, by which it is scaled for that search [its unit]. Larger makes
steps too coarse for small ones, smaller divides by nothing where one starts at zero. Chosen by
hand."""
SOLVED = 1e-14
"""Relative change of the parameters and of the cost at which the bounded search ends. Larger ends
short of the bounds, smaller is below a double's rounding, 2e-16, and never reached. Chosen by
hand."""


@dataclass(frozen=True)
class Regression:
    """y = X b + noise, and the way from b to theta; m rows, n parameters."""

    X: Array
    """(m, n)"""
    y: Array
    """(m,)"""
    inertia: int | None
    """Index of the inertia in theta where the acceleration is on the left."""

    def theta(self, b: Array) -> Array:
        """Return theta (n,) of the coefficients b (n,)."""
        return b if self.inertia is None else turned(b, self.inertia)

    def coefficients(self, theta: Array) -> Array:
        """Return b (n,) of theta (n,); its own inverse."""
        return self.theta(theta)

    def jacobian(self, b: Array) -> Array:
        """Return d theta / d b, shape (n, n)."""
        return np.eye(len(b)) if self.inertia is None else turned_jacobian(b, self.inertia)


def regression(psi: Array, command: Array, model: EffectList, left: Side) -> Regression:
    """Arrange psi (m, n) and the command (m,) for the side that goes on the left.

    A model without inertia can only have the command on the left.
    """
    inertia = model.index_of("acceleration")
    if left == "command" or inertia is None:
        return Regression(psi, command, None)
    X = psi.copy()
    X[:, inertia] = command
    return Regression(X, psi[:, inertia], inertia)


@dataclass(frozen=True)
class Solution:
    """Coefficients of a regression and what is needed to judge them."""

    b: Array
    residual: Array
    """y - X b, (m,)"""
    condition: float
    """Of X with its columns scaled to length one."""
    bread: Array
    """(X'X)^-1, (n, n), finite also where the data leaves a direction open."""
    open_directions: Array
    """(k, n) in b scaled by the columns' lengths: what the data does not determine."""


def solve(problem: Regression) -> Solution:
    """Minimise |y - X b|, with the least scaled |b| in directions the data leaves open."""
    scale = np.linalg.norm(problem.X, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    U, s, Vt = np.linalg.svd(problem.X / scale, full_matrices=False)
    known = s > SMALLEST_SINGULAR_VALUE * s[0]
    b = (Vt[known].T @ ((U[:, known].T @ problem.y) / s[known])) / scale
    floored = np.maximum(s, SMALLEST_SINGULAR_VALUE * s[0])
    half = (Vt.T / floored) / scale[:, None]
    return Solution(
        b=b,
        residual=problem.y - problem.X @ b,
        condition=float(s[0] / floored[-1]),
        bread=half @ half.T,
        open_directions=Vt[~known],
    )


@dataclass(frozen=True)
class Bounded:
    """The least-squares solution within the bounds of theta."""

    theta: Array
    at_lower: Flags
    at_upper: Flags


def solve_bounded(problem: Regression, start: Array, lower: Array, upper: Array) -> Bounded:
    """Minimise |y - X b(theta)| over lower <= theta <= upper, all of shape (n,).

    The rows are first compressed to n by an orthogonal factorisation.
    """
    R = np.linalg.qr(np.column_stack([problem.X, problem.y]), mode="r")
    size = np.maximum(np.abs(start), LEAST_SIZE)
    low, high = lower / size, upper / size
    inside = np.clip(start / size, low, high)

    def residual(scaled: Array) -> Array:
        b = problem.coefficients(scaled * size)
        return np.asarray(R @ np.append(b, -1.0))

    found = least_squares(residual, inside, bounds=(low, high), xtol=SOLVED, ftol=SOLVED)
    theta = np.clip(found.x * size, lower, upper)
    near = ON_BOUND * size
    at_lower, at_upper = theta - lower <= near, upper - theta <= near
    theta = np.where(at_lower, lower, np.where(at_upper, upper, theta))
    return Bounded(theta, at_lower, at_upper)
