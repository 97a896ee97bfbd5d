"""What an identification gives: estimates with their uncertainty, axis by axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.measured import Measured
from motorctl.identify.fit.regression_data import RegressionData
from motorctl.identify.fit.settings import Estimator, FitOptions
from motorctl.model import EffectList

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Bound = Literal["lower", "upper"]

WEAK = 5.0
"""Standard error over that of another estimate, beyond which this one says nothing about that.
Larger compares with instruments that hardly move, smaller drops sound ones: those of the reference
are always a little less sure. Chosen by hand."""
SIGNIFICANT = 3.0
"""Difference of two estimates, in standard errors of the difference, from which it is more than
chance. Larger overlooks bias, smaller tells chance as one. Convention: three standard
deviations."""
MATTERS = 0.01
"""Part of the command's rms that two estimates of a term must differ by, to disagree. Larger
overlooks bias, smaller tells differences that no controller feels. Chosen by hand."""


@dataclass(frozen=True)
class FitEstimate:
    """theta (n,) in units of the command, and the delay [s]."""

    theta: Array
    delay_s: float
    covariance: Array
    """(n + 1, n + 1) of theta and the delay; zero where something is fixed."""
    at_bound: Mapping[str, Bound] = field(default_factory=dict)
    """Parameters that stand at a physical bound, by full name."""

    @property
    def std_error(self) -> Array:
        """Standard errors of theta, (n,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance)[:-1], 0.0))

    @property
    def delay_std_error_s(self) -> float:
        """Standard error of the delay."""
        return float(np.sqrt(max(self.covariance[-1, -1], 0.0)))

    def weaker_than(self, other: FitEstimate) -> Flags:
        """Return which parameters (n,) this estimate hardly determines beside the other."""
        return np.asarray(self.std_error > WEAK * other.std_error)

    def disagrees_with(self, other: FitEstimate, psi: Array, command: Array) -> Flags:
        """Return which parameters (n,) differ significantly, and by something that matters.

        `psi` (m, n) and `command` (m,) weigh a difference by what it does to the command.
        """
        difference = np.abs(self.theta - other.theta)
        significant = difference > SIGNIFICANT * np.hypot(self.std_error, other.std_error)
        weight = np.linalg.norm(psi, axis=0) / np.linalg.norm(command)
        return np.asarray(significant & (difference * weight > MATTERS))


@dataclass(frozen=True)
class FitError:
    """What a model leaves of the command in the fitted band."""

    rms: float
    """In units of the command."""
    relative: float
    """|residual| / |command|."""
    source: str
    duration_s: float
    """Of the rows that were compared."""


@dataclass(frozen=True)
class AxisFit:
    """The identified model of one axis; n parameters in the order of `model`."""

    data: Measured
    model: EffectList
    """With the sign function's slope as it was used."""
    options: FitOptions
    """With everything filled in."""
    columns: RegressionData
    """The rows that were fitted; m rows."""
    estimator: Estimator
    """Which of the two estimates gives the values."""
    least_squares: FitEstimate
    instruments: FitEstimate | None
    """None where the reference is unknown or does not excite."""
    error: FitError
    held_out: FitError | None
    residual: Array
    """(m,) command minus model, in units of the command."""
    condition: float
    """Of the regressor with its columns scaled to length one."""
    notes: tuple[str, ...]

    @property
    def estimate(self) -> FitEstimate:
        """The estimate that gives the values."""
        if self.estimator == "instruments" and self.instruments is not None:
            return self.instruments
        return self.least_squares

    @property
    def theta(self) -> Array:
        """The parameters (n,) in units of the command."""
        return self.estimate.theta

    @property
    def std_error(self) -> Array:
        """Standard errors of theta, (n,), honouring serial correlation and the delay's error."""
        return self.estimate.std_error

    @property
    def delay_s(self) -> float:
        """The input delay; positive: the command acts later."""
        return self.estimate.delay_s

    def value(self, name: str) -> float:
        """Return one parameter by its full name."""
        return float(self.theta[self.model.parameter_names.index(name)])

    def weak(self) -> Flags:
        """Return which parameters (n,) the instruments hardly determine."""
        if self.instruments is None:
            return np.ones(len(self.theta), dtype=np.bool_)
        return self.instruments.weaker_than(self.least_squares)

    def disagreement(self) -> Flags:
        """Return on which parameters (n,) instruments and least squares disagree."""
        if self.instruments is None:
            return np.zeros(len(self.theta), dtype=np.bool_)
        psi, command = self.columns.at(self.delay_s)
        differs = self.instruments.disagrees_with(self.least_squares, psi, command)
        return np.asarray(differs & ~self.weak())


@dataclass(frozen=True)
class RecordingFit:
    """The identified axes of a recording."""

    source: str
    sample_rate_hz: float
    duration_s: float
    axes: Mapping[str, AxisFit]
    refused: Mapping[str, str]
    """Why the other axes could not be identified."""
    notes: tuple[str, ...] = ()

    # What words need, rich among it, is imported when somebody asks for them.

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``fit --json``."""
        from motorctl.identify.fit.report import fit_document

        return fit_document(self)

    def to_pandas(self) -> pd.DataFrame:
        """Return a row a parameter: axis, parameter, value, std_error, unit, and as a force.

        Raises UsageError where pandas is not installed.
        """
        from motorctl.identify.fit.report import fit_frame

        return fit_frame(self)

    def __repr__(self) -> str:
        parts = [f"{name}: {', '.join(axis.model.names)}" for name, axis in self.axes.items()]
        return f"<RecordingFit {self.source}: {'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        from motorctl.identify.fit.report import fit_html

        return fit_html(self)
