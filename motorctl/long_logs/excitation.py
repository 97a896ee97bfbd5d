"""How much the motion in each row group of a long log tells of the declared parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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

    def vagueness(self) -> NDArray[np.float64]:
        """Return what each term moves within its standard error, in parts of the command, (n,).

        This is what `fit` notes of a poorly determined parameter, before anything is fitted: rows
        closer than residuals correlate count as one. Infinite where there are too few.
        """
        gram, rows = self.products.gram, self.products.rows
        n = len(gram) - 1
        together = max(1.0, SHORTEST_CORRELATION_S / self.row_period_s)
        if rows / together <= n or gram[-1, -1] <= 0.0:
            return np.full(n, np.inf)
        variance = self.products.left_over / (rows - n) * together
        size = np.sqrt(gram.diagonal()[:-1] / gram[-1, -1])
        found = np.sqrt(variance) * self.products.errors * size
        return np.where(size > 0.0, found, np.inf)


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
        return None, columns.options
    return Excitation(Products(rows.T @ rows, len(rows), ()), columns.row_period_s), columns.options


Scanned = Mapping[str, Sequence[Excitation | None]]
"""Of each axis what each row group tells; None: nothing."""
