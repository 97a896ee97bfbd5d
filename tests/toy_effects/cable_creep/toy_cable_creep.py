"""A cable chain that yields: a spring whose force dies away."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans

Array = NDArray[np.float64]


class CableCreepOptions(EffectOptions):
    """How long the cable remembers."""

    relaxation_s: float = Field(gt=0, allow_inf_nan=False, description="time of the relaxation")


class CableCreep(Effect):
    """k s with ds/dt = v - s/T (a Maxwell element)."""

    name = "cable_creep"
    kind = "state"
    memory = 2
    title = "Cable that creeps"
    formula = "k * s,  ds/dt = v - s/T"
    compensated = "feedforward of the stretch along the desired motion"
    identified = "linear in k; the time T by a scan"
    visible_in = "moves that last about T, with rests of about T between them"
    revealed_by = ("longer_run",)
    Options = CableCreepOptions
    options: CableCreepOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """k."""
        return (Parameter("stiffness", "k", "V/m", -1e3, 1e3, 0.0, 1.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """1/T [1/s]."""
        return (1.0 / self.options.relaxation_s,)

    @property
    def picture(self) -> Picture:
        """Over time."""
        return Picture("over_time", "Pull of the cable over time.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return times from some hundredths of a second on."""
        times = np.geomspace(0.03, 1.0, 12)
        return [cls(CableCreepOptions(relaxation_s=float(time))) for time in times]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of the time."""
        return {"relaxation_s": 0.2 * self.options.relaxation_s}


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, w: Array, c: tuple[float, ...]
) -> float:
    """Return the stretch [m]; w is (stretch, started)."""
    return float(w[0])


@njit
def advance(
    w: Array, x: float, v: float, a: float, dt: float, others: Array, c: tuple[float, ...]
) -> None:
    """Stretch by the way that was made, and let go."""
    decay = math.exp(-dt * c[0])
    w[0] = w[0] * decay + v * (1.0 - decay) / c[0]
    w[1] = 1.0
