"""One magnet of the way is weak: there a command makes less force."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans


class WeakMagnetOptions(EffectOptions):
    """Where the magnet lies."""

    place_m: float = Field(allow_inf_nan=False, description="middle of the weak magnet")
    width_m: float = Field(gt=0, allow_inf_nan=False, description="distance at which e^-1 is left")


class WeakMagnet(Effect):
    """v(u) = u (1 - g exp(-((x - x_0)/b)^2))."""

    name = "weak_magnet"
    kind = "input"
    odd = True
    varies = True
    title = "Weak magnet"
    formula = "v(u) = u * (1 - g * exp(-((x - x_0)/b)^2))"
    compensated = "inversion of the input map at the desired position"
    identified = "linear in g; place and width by a scan"
    visible_in = "large commands at the place and beside it"
    revealed_by = ("two_accelerations",)
    Options = WeakMagnetOptions
    options: WeakMagnetOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """g."""
        return (Parameter("", "g", "1", -0.9, 0.9, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """x_0 [m] and 1/b [1/m]."""
        return self.options.place_m, 1.0 / self.options.width_m

    @property
    def picture(self) -> Picture:
        """Over time."""
        return Picture("over_time", "What the weak magnet takes, over time.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return three widths all over the travel."""
        if not spans.travel_m > 0.0:
            return ()
        low, high = spans.position_m
        return [
            cls(WeakMagnetOptions(place_m=float(place), width_m=share * spans.travel_m))
            for share in (0.03, 0.06, 0.12)
            for place in np.linspace(low, high, 25)[1:-1]
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of both."""
        return {"place_m": 0.02 * spans.travel_m, "width_m": 0.02 * spans.travel_m}


@njit(inline="always")
def _weak(x: float, c: tuple[float, ...]) -> float:
    return math.exp(-(((x - c[0]) * c[1]) ** 2))


@njit(inline="always")
def column(j: int, u: float, x: float, t: float, c: tuple[float, ...]) -> float:
    """Return minus what g takes of the command here."""
    return -u * _weak(x, c)


@njit(inline="always")
def slope(j: int, u: float, x: float, t: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    return -_weak(x, c)
