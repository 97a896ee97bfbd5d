"""A motor with a solid core: eddy currents hold a part of the thrust back for a while."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans

Array = NDArray[np.float64]


class SlowCoreOptions(EffectOptions):
    """How long the part is held back."""

    rise_s: float = Field(gt=0, allow_inf_nan=False, description="time constant of the core")


class SlowCore(Effect):
    """v(u) = u - q (u - p), p' = (u - p)/T."""

    name = "slow_core"
    kind = "input"
    memory = 1
    title = "Slow part of the thrust"
    formula = "v(u) = u - q * (u - p),  p' = (u - p)/T"
    compensated = "inversion of the input map from the present state of the core"
    identified = "linear in q; the time constant T by a scan"
    visible_in = "commands that change slowly and quickly, within T and over several T"
    revealed_by = ("fast_reversals",)
    Options = SlowCoreOptions
    options: SlowCoreOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """q."""
        return (Parameter("share", "q", "1", -0.9, 0.9, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """1/T [1/s]."""
        return (1.0 / self.options.rise_s,)

    @property
    def picture(self) -> Picture:
        """What acts for a command."""
        return Picture("command_response", "What acts, for a command.")

    def memories(self) -> Sequence[tuple[float, ...]]:
        """Return states of the core from end to end."""
        return [(float(place),) for place in np.linspace(-10.0, 10.0, 9)]

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return time constants from some hundredths of a second to a second."""
        return [cls(SlowCoreOptions(rise_s=float(time))) for time in np.geomspace(0.02, 1.0, 14)]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of the time constant."""
        return {"rise_s": 0.2 * self.options.rise_s}


@njit(inline="always")
def column(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return minus what the core holds back."""
    return float(w[0] - u)


@njit(inline="always")
def slope(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return its derivative: at once, all of the part is held back."""
    return -1.0


@njit
def advance(w: Array, u: float, dt: float, c: tuple[float, ...]) -> None:
    """Let the core follow the command that acts."""
    w[0] = u + (w[0] - u) * math.exp(-dt * c[0])
