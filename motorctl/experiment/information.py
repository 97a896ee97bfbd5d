"""How much a motion tells: between two hypotheses, and of the parameters of one.

T-optimality: data that follow one hypothesis are fitted with the other, all its parameters free
and its options too; what it must leave all the same, over twice the variance of the noise, is the
log-likelihood that a motion is expected to part the two by. D-optimality: how much smaller the
standard errors become. Both count from what the recording so far has told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import Effect, Spans

Array = NDArray[np.float64]

STEP = 0.05
"""Step of an option over which its column is differenced, in the first steps of its search. Larger
leaves the straight line, smaller drowns in rounding. By hand, as for its standard error."""
RIDGE = 1e-10
"""On the diagonal of products of columns of length one: keeps what is collinear solvable. Larger
hides what tells two apart, smaller is lost in rounding. By hand."""


@dataclass(frozen=True)
class Products:
    """Products of the columns of a hypothesis, (n + 1, n + 1): the left side is the last."""

    gram: Array
    rows: int
    options: tuple[tuple[str, str], ...]
    """Effect and option of the last columns."""

    def plus(self, more: Products) -> Products:
        """Return those of both motions together."""
        return Products(self.gram + more.gram, self.rows + more.rows, self.options)

    @property
    def left_over(self) -> float:
        """Sum of squares that the best parameters leave."""
        scale, inverse = self._inverse()
        g = self.gram[:-1, -1] / scale
        return max(float(self.gram[-1, -1] - g @ inverse @ g), 0.0)

    @property
    def best(self) -> Array:
        """The parameters that leave least, (n,)."""
        scale, inverse = self._inverse()
        return np.asarray(inverse @ (self.gram[:-1, -1] / scale) / scale)

    @property
    def errors(self) -> Array:
        """Standard errors of all parameters, for noise of variance one, (n,)."""
        scale, inverse = self._inverse()
        return np.asarray(np.sqrt(np.maximum(inverse.diagonal(), 0.0)) / scale)

    def _inverse(self) -> tuple[Array, Array]:
        squares = self.gram.diagonal()[:-1]
        scale = np.sqrt(np.where(squares > 0.0, squares, 1.0))
        A = self.gram[:-1, :-1] / np.outer(scale, scale)
        return scale, np.linalg.inv(A + RIDGE * np.eye(len(A)))


def products_of(hypothesis: Hypothesis, spans: Spans) -> Products:
    """Return the products of the columns of a hypothesis over its own signals.

    The options of what it adds are linear near where they are: each has a column of its own.
    """
    rows = hypothesis.regressors.signals.rows
    columns = hypothesis.problem.joined(rows)
    b = hypothesis.solution.b
    names, extra = [], []
    for effect in hypothesis.added:
        for name, step in effect.steps(spans).items():
            column = _by_option(hypothesis, effect, name, STEP * step, b)
            if column is not None:
                names.append((effect.name, name))
                extra.append(column)
    all_of = np.vstack([columns[:-1], *extra, columns[-1:]])
    return Products(all_of @ all_of.T, rows, tuple(names))


def products_on(hypothesis: Hypothesis, signals: Signals, spans: Spans) -> Products:
    """Return the same over other signals, the parameters being those that were fitted before."""
    return products_of(hypothesis.on(signals), spans)


def parted_by(
    rival: tuple[Products, Products], truth: tuple[Products, Products], variance: float
) -> float:
    """Return the log-likelihood by which a motion is expected to part a rival from the truth.

    Parameters
    ----------
    rival, truth
        Products over what was recorded, and over the motion were the truth true.
    variance
        Of the rows' noise.
    """
    more = [known.plus(new).left_over - known.left_over for known, new in (rival, truth)]
    return max(0.5 * (more[0] - more[1]) / variance, 0.0)


@dataclass(frozen=True)
class Trace:
    """What an effect that was not seen would leave of the rows, were it as large as it may be."""

    effect: Effect
    size: float
    """The coefficient of each of its columns."""

    def shown(self, products: list[Products], variance: float) -> float:
        """Return the log-likelihood that shows it: what the other columns leave of its own."""
        return max((0.5 * self.size**2 * each.left_over / variance for each in products), default=0)


def products_with(hypothesis: Hypothesis, effect: Effect) -> list[Products]:
    """Return the products of the columns, with each of an effect's own in turn as the left side."""
    problem = hypothesis.extended(effect)
    rows, n = hypothesis.regressors.signals.rows, hypothesis.problem.size
    total = problem.total
    orders = [[*range(n), i] for i in range(n, problem.size)]
    return [Products(total[np.ix_(order, order)], rows, ()) for order in orders]


def _by_option(
    hypothesis: Hypothesis, effect: Effect, name: str, step: float, b: Array
) -> Array | None:
    """Return how the model's rows change with an option, for each unit of it, (m,)."""
    rows, value = hypothesis.regressors.signals.rows, float(getattr(effect.options, name))
    sides = []
    for moved in (value + step, value - step):
        try:
            other = hypothesis.exchanged(effect.with_options(**{name: moved}))
        except ValidationError:
            return None
        sides.append(b @ other.problem.joined(rows)[:-1])
    return np.asarray((sides[0] - sides[1]) / (2.0 * step))
