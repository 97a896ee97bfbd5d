"""Iron that saturates from a knee on, unlike for push and pull."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans


class IronKneeOptions(EffectOptions):
    """Where saturation begins."""

    knee_v: float = Field(gt=0, allow_inf_nan=False, description="command of the knee")


class IronKnee(Effect):
    """v(u) = u - p (u - k)^2 for u > k, u + q (u + k)^2 for u < -k."""

    name = "iron_knee"
    kind = "input"
    electromagnetic = True
    title = "Saturation beyond a knee"
    formula = "v(u) = u - p * max(u - k, 0)^2 + q * max(-u - k, 0)^2"
    compensated = "inversion of the input map"
    identified = "linear in p and q; the knee k by a scan"
    visible_in = "commands of both signs up to the range that is to be known"
    revealed_by = ("two_accelerations",)
    Options = IronKneeOptions
    options: IronKneeOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """p and q."""
        return (
            Parameter("push", "p", "1/V", -0.045, 0.045, 0.0, 0.01),
            Parameter("pull", "q", "1/V", -0.045, 0.045, 0.0, 0.01),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """k [V]."""
        return (self.options.knee_v,)

    @property
    def picture(self) -> Picture:
        """Force for a command."""
        return Picture("acting_command", "What acts, for a command.", scale=self.options.knee_v)

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return knees from a tenth to most of the largest command."""
        if not spans.command_v > 0.0:
            return ()
        knees = spans.command_v * np.linspace(0.1, 0.8, 12)
        return [cls(IronKneeOptions(knee_v=float(knee))) for knee in knees]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of the knee."""
        return {"knee_v": 0.05 * spans.command_v}


@njit(inline="always")
def column(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return what p, or q, takes."""
    over = max(u - c[0], 0.0) if j == 0 else max(-u - c[0], 0.0)
    return -over * over if j == 0 else over * over


@njit(inline="always")
def slope(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    over = max(u - c[0], 0.0) if j == 0 else max(-u - c[0], 0.0)
    return -2.0 * over
