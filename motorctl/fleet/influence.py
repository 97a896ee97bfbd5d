"""How a series goes with what was recorded beside it, as temperature or load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.fleet.change import (
    FEWEST_POINTS,
    Change,
    beginning_of,
    change_in,
    criterion,
    drawn_in,
    rest_scatter,
    scatter_of,
    steps_in,
    told_alone,
)

Array = NDArray[np.float64]

POINTS_EACH = 4
"""Further points that each covariate asks of a series. Fewer let it follow noise, more use it
later. Chosen by hand: beside those that a series needs anyway."""
ALIKE = 0.02
"""Part of a drift's squares that covariates must not look like for slopes to be fitted beside it.
Larger takes drifts for the covariate's, smaller lets both grow against each other.
Chosen by hand."""
PASSES = 2
"""Times that slopes are fitted: outliers are drawn in to what the time before left. Arithmetic."""


@dataclass(frozen=True)
class Influence:
    """How far covariates move a series."""

    names: tuple[str, ...]
    slope: Array
    """By how much the value grows for one unit of each, (m,)."""
    std_error: Array
    """(m,)"""
    explained: float
    """Part of the series' variance that goes with them."""
    adjusted: Array
    """The series as if they had not varied, (N,)."""
    beside: Array
    """They themselves, less what they are told for, (N, m)."""

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        by_name = zip(self.names, self.slope, self.std_error, strict=True)
        return {
            "covariates": {
                name: {"slope": float(slope), "std_error": float(error)}
                for name, slope, error in by_name
            },
            "explained_fraction": self.explained,
        }


@dataclass(frozen=True)
class Remainder:
    """What is left of a change once covariates are accounted for."""

    value: float
    std_error: float


def influence_on(value: Array, beside: Array, names: tuple[str, ...]) -> Influence | None:
    """Return how a series goes with covariates; None where it is too short, or they never vary.

    Slopes are fitted together with the form that leaves least for its parameters: no change, steps,
    or a drift, sought in the series as it is and in what a plain regression leaves of it. So a
    change of its own is not taken for the covariate's, as far as the two differ; how far they do
    not is what `change_in` makes errors larger for.

    Parameters
    ----------
    value
        The series, (N,).
    beside
        A column of each covariate, less what the series is to be told for, (N, m).
    names
        Of the covariates.
    """
    n = len(value)
    if n < FEWEST_POINTS + POINTS_EACH:
        return None
    varies = np.ptp(beside, axis=0) > 1e-9 * np.max(np.abs(beside), axis=0, initial=0.0)
    beside = beside[:, varies]
    count = beside.shape[1]
    if not count or n < FEWEST_POINTS + POINTS_EACH * count or not np.ptp(value):
        return None
    names = tuple(name for name, used in zip(names, varies, strict=True) if used)
    slope = np.zeros(count)
    for _ in range(PASSES):
        slope = _slope(value, beside, slope)
    left, noise = drawn_in(value - beside @ slope)
    steps = steps_in(left, noise)
    columns = np.column_stack([_levels(n, steps), beside])
    scatter, together = scatter_of(left, steps, noise)
    covariance = scatter**2 * together * np.linalg.pinv(columns.T @ columns)
    errors = np.sqrt(np.diag(covariance)[-count:])
    moved = beside @ slope
    explained = float(np.var(moved) / (np.var(moved) + np.var(left)))
    return Influence(names, slope, errors, explained, value - moved, beside)


def remainder_of(change: Change, value: Array, influence: Influence) -> Remainder:
    """Return how large a change of the plain series is beside its covariates."""
    n = len(value)
    rise = np.arange(n) - float(change.first)
    column = np.maximum(0.0, rise) if change.form == "drift" else (rise >= 0.0).astype(float)
    values, noise = drawn_in(influence.adjusted)
    values = values + influence.beside @ influence.slope
    columns = np.column_stack([column, np.ones(n), influence.beside])
    fitted = np.linalg.lstsq(columns, values, rcond=None)[0]
    left, further = values - columns @ fitted, columns.shape[1] - 1
    scatter, together = rest_scatter(left, further, noise)
    alone = told_alone(column, influence.beside)
    spread = float(np.sum((column - np.mean(column)) ** 2)) * alone
    error = scatter * math.sqrt(together / spread) if spread > 0.0 else math.inf
    high = float(column[-1])
    return Remainder(float(fitted[0]) * high, error * high)


def _slope(value: Array, beside: Array, before: Array) -> Array:
    """Return the slopes beside the best form, with outliers drawn in to what `before` leaves."""
    n, count = beside.shape
    clean = drawn_in(value - beside @ before)[0] + beside @ before
    plain = _fitted(clean, _levels(n, []), beside)[1]
    designs: list[tuple[Array, int]] = [(_levels(n, []), 1)]
    for start in (np.zeros(count), plain):
        left, noise = drawn_in(clean - beside @ start)
        steps = steps_in(left, noise)
        designs.append((_levels(n, steps), 2 * len(steps) + 1))
        firsts = [0] + ([beginning_of(left)[0]] if n > FEWEST_POINTS + 1 else [])
        for first in firsts:
            rise = np.maximum(0.0, np.arange(n) - float(first))
            if told_alone(rise, beside) < ALIKE:
                continue
            designs.append((np.column_stack([np.ones(n), rise]), 3 if first else 2))
    found = []
    for design, parameters in designs:
        squares, slope = _fitted(clean, design, beside)
        found.append((criterion(squares, n, parameters), slope))
    return min(found, key=lambda each: each[0])[1]


def _fitted(value: Array, design: Array, beside: Array) -> tuple[float, Array]:
    """Return what a form with covariates leaves, in squares, and their slopes."""
    columns = np.column_stack([design, beside])
    fitted = np.asarray(np.linalg.lstsq(columns, value, rcond=None)[0], np.float64)
    left = value - columns @ fitted
    return float(left @ left), fitted[design.shape[1] :]


def _levels(n: int, steps: list[int]) -> Array:
    """Return a column for each part between steps."""
    part = np.searchsorted(np.array(steps, int), np.arange(n), side="right")
    return np.asarray(part[:, None] == np.arange(len(steps) + 1), np.float64)


def change_beside(influence: Influence) -> Change | None:
    """Return the clearest change of a series that its covariates do not tell."""
    return change_in(influence.adjusted, influence.beside)
