"""From the stretches of a recording to the rows of a regression: one way for `fit` and `diagnose`.

Nonlinear terms are formed first, over each stretch (`Stretch.columns`); then one linear filter goes
over every column alike, so that the equation u = sum theta_i psi_i still holds; then rows are
picked. Which filter that is, and which samples are rows, is all in which the two differ:
`Signals` has a zero-phase filter of any shape, whose noise can be made white, and `RegressionData`
the recursive ones that the literature identifies machines with.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import CommandPath
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.stretches import Stretch
from motorctl.model import Effect, EffectList

Array = NDArray[np.float64]
Formed = TypeVar("Formed")
"""Columns of one stretch on their way to rows: what a filter keeps of them."""


@dataclass(frozen=True)
class Rows(ABC, Generic[Formed]):
    """The stretches of one axis, and what makes m rows of columns over them."""

    data: Measured
    stretches: tuple[Stretch, ...]

    @property
    def period_s(self) -> float:
        """Time between the samples of the recording."""
        return self.data.period_s

    @abstractmethod
    def formed(self, columns: Array, step: int = 1) -> Formed:
        """Bring columns of one stretch, (p, N), behind the filter; given at each step-th sample."""

    @abstractmethod
    def rows_of(self, formed: Iterable[Formed]) -> Array:
        """Return the rows, (p, m), of columns of every stretch."""

    @abstractmethod
    def input(self, effect: Effect | None, path: CommandPath, *, keep: bool = False) -> Array:
        """Return the columns of an input effect, (p, m), of the command that acts behind a path.

        Without an effect it is that command itself, (1, m). keep has them kept, for a form that
        will be asked for again.
        """

    def inputs(self, effects: Sequence[Effect], path: CommandPath, *, keep: bool = False) -> Array:
        """Return the command and the columns of input effects at the rows, (1 + p, m)."""
        return np.concatenate([self.input(each, path, keep=keep) for each in (None, *effects)])

    def state(
        self, effect: Effect, acceleration: Sequence[Array] | None = None, step: int = 1
    ) -> Array:
        """Return the columns of a state effect, (p, m).

        acceleration is that of each stretch at the full rate; by default none, zero. step is the
        decimation at which the columns are formed.
        """
        return self.rows_of(self.over(effect, acceleration, step))

    def over(
        self, effect: Effect, acceleration: Sequence[Array] | None, step: int
    ) -> Iterator[Formed]:
        """Form the columns of a state effect, one stretch after the other."""
        for k, stretch in enumerate(self.stretches):
            a = None if acceleration is None else acceleration[k]
            yield self.formed(stretch.columns(effect, a, step=step), step)

    def regression(
        self, model: EffectList, path: CommandPath, acceleration: Sequence[Array]
    ) -> tuple[Array, Array]:
        """Return the columns psi of a model at the measured motion, and the command that acts.

        Parameters
        ----------
        model
            n parameters; effects that have none, such as a delay, are in `path`.
        path
            What happens to the command before it acts.
        acceleration
            Of each stretch, (N,), at the full rate.

        Returns
        -------
        tuple of Array
            psi, (n, m), and the command, (m,).
        """
        columns = [
            self.input(effect, path, keep=True)
            if effect.kind == "input"
            else self.state(effect, acceleration)
            for effect in model.effects
            if effect.parameters
        ]
        return np.concatenate(columns), self.input(None, path, keep=True)[0]
