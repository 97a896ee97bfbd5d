"""Two scales in a row that do not quite meet: the reading shifts at their joint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans

STEPS = 20


class ScaleJointOptions(EffectOptions):
    """Where the joint is, and how much the reading shifts there."""

    place_m: float = Field(allow_inf_nan=False, description="middle of the joint")
    width_m: float = Field(ge=1e-4, allow_inf_nan=False, description="length of the read head")
    shift_m: float = Field(
        default=0.0, ge=-4e-5, le=4e-5, description="half of what the reading shifts by"
    )


class ScaleJoint(Effect):
    """The encoder shows y = x + s tanh((x - x_0)/b)."""

    name = "scale_joint"
    kind = "measurement"
    title = "Joint of two scales"
    formula = "y = x + s * tanh((x - x_0)/b)"
    compensated = "correction of the measured position"
    identified = "linear in the shift s; place and width by a scan"
    visible_in = "passing the joint at two different speeds"
    amplitudes = ("shift_m",)
    revealed_by = ("two_speeds",)
    Options = ScaleJointOptions
    options: ScaleJointOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the error is an option."""
        return ()

    @property
    def constants(self) -> tuple[float, ...]:
        """x_0 [m], 1/b [1/m] and s [m]."""
        return self.options.place_m, 1.0 / self.options.width_m, self.options.shift_m

    @property
    def picture(self) -> Picture:
        """Over time."""
        return Picture("over_time", "What the joint seems to push, over time.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return two widths all over the travel."""
        low, high = spans.position_m
        return [
            cls(ScaleJointOptions(place_m=float(place), width_m=width))
            for width in (2e-3, 5e-3)
            for place in np.arange(low, high, 0.8 * width)[1:]
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of place and width."""
        return {"place_m": 1e-3, "width_m": 0.2 * self.options.width_m}


@njit(inline="always")
def column(j: int, x: float, c: tuple[float, ...]) -> float:
    """Return what the encoder shows too much for a shift of one."""
    return math.tanh((x - c[0]) * c[1])


@njit
def correct(y: float, c: tuple[float, ...]) -> float:
    """Return the position x that the encoder shows as y."""
    x = y
    for _ in range(STEPS):
        x = y - c[2] * math.tanh((x - c[0]) * c[1])
    return x
