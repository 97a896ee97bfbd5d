"""How much the motion in each row group of a long log tells of the declared parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.experiment.information import Products
from motorctl.identify.columns.measured import Measured
from motorctl.identify.fit.recording import SHORTEST_CORRELATION_S
from motorctl.identify.fit.regression_data import prepare
from motorctl.identify.fit.settings import FitOptions
from motorctl.model import EffectList


@dataclass(frozen=True)
class Excitation:
    """What some row groups tell: products of the columns that `fit` forms, the command last."""

    products: Products
    row_period_s: float
    """Between the rows of the fit."""

    def plus(self, more: Excitation) -> Excitation:
        """Return that of both together."""
        return Excitation(self.products.plus(more.products), self.row_period_s)

    @property
    def together(self) -> float:
        """Return how many rows count as one, as they are closer than residuals correlate."""
        return max(1.0, SHORTEST_CORRELATION_S / self.row_period_s)

    @property
    def tells(self) -> bool:
        """Return whether it has more independent rows than there are parameters."""
        gram, rows = self.products.gram, self.products.rows
        return bool(rows / self.together > len(gram) - 1 and gram[-1, -1] > 0.0)

    @property
    def variance(self) -> float:
        """Return what its own best parameters leave, of an independent row; needs `tells`."""
        rows, n = self.products.rows, len(self.products.gram) - 1
        return self.products.left_over / (rows - n) * self.together

    def vagueness(self, variance: float) -> NDArray[np.float64]:
        """Return what each term moves within its standard error, in parts of the command, (n,).

        This is what `fit` notes of a poorly determined parameter, before anything is fitted.
        Infinite where there are too few rows.

        Parameters
        ----------
        variance
            Of an independent row: that of the whole log, or motion during which the model lacks
            something would seem to tell little.
        """
        gram = self.products.gram
        if not self.tells:
            return np.full(len(gram) - 1, np.inf)
        size = np.sqrt(gram.diagonal()[:-1] / gram[-1, -1])
        found = np.sqrt(variance) * self.products.errors * size
        return np.where(size > 0.0, found, np.inf)

    def left_rms(self, theta: NDArray[np.float64]) -> float:
        """Return the rms of what parameters (n,) leave of the command in its rows."""
        b = np.append(-theta, 1.0)
        return float(np.sqrt(max(b @ self.products.gram @ b, 0.0) / self.products.rows))


@dataclass(frozen=True)
class Usual:
    """What holds for all of a log: by it one stretch is compared with another."""

    theta: NDArray[np.float64]
    """(n,) the declared model's best parameters of the whole log."""
    variance: float
    """Of an independent row: the median of the row groups'."""


def usual_of(told: Iterable[Excitation | None]) -> Usual | None:
    """Return what holds for all row groups of an axis; None where none tells anything.

    Parameters
    ----------
    told
        What each row group tells; None: nothing.
    """
    found = [each for each in told if each is not None]
    if not found:
        return None
    whole = reduce(Excitation.plus, found)
    if not whole.tells:
        return None
    variances = [each.variance for each in found if each.tells]
    return Usual(whole.products.best, float(np.median(variances)) if variances else whole.variance)


def excitation_of(
    data: Measured, model: EffectList, options: FitOptions | None
) -> tuple[Excitation | None, FitOptions | None]:
    """Return what a piece of an axis tells, and the choices of its fit for the pieces after it.

    Parameters
    ----------
    data
        One row group of the axis.
    model
        What is declared.
    options
        As the piece before left them, so that products can be added; None for the first one.

    Returns
    -------
    excitation, options
        None where no motion is left in it.
    """
    try:
        columns = prepare(data, model, options or FitOptions(estimate_delay=False))
    except (DataError, ValueError):
        return None, options
    psi, command = columns.at(0.0)
    rows = np.column_stack([psi, command])
    if not len(rows):
        return None, options
    found = Excitation(Products(rows.T @ rows, len(rows), ()), columns.row_period_s)
    return found, columns.options


Scanned = Mapping[str, Sequence[Excitation | None]]
"""Of each axis what each row group tells; None: nothing."""
