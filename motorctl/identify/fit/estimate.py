"""One estimate of the parameters and of the input delay, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Bound = Literal["lower", "upper"]

WEAK = 5.0
"""An estimate whose standard error exceeds so many of another's says nothing about it."""
SIGNIFICANT = 3.0
"""Standard errors of the difference."""
MATTERS = 0.01
"""Of the command's rms: a smaller difference of a term is no disagreement."""


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
