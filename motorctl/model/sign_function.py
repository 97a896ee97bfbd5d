"""The sign function Sf of friction: its shape, and how steep it is."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple, get_args

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions

Shape = Literal["arctan", "tanh", "algebraic", "rational", "clip"]
SHAPES: tuple[Shape, ...] = get_args(Shape)
"""Forms of Sf in use; a compiled kernel knows each by its place here."""


class Sign(NamedTuple):
    """How friction turns over at zero speed."""

    slope_s_m: float
    shape: Shape = "arctan"

    @property
    def constants(self) -> tuple[float, float]:
        """What a kernel needs of it: slope [s/m] and number of the shape."""
        return self.slope_s_m, float(SHAPES.index(self.shape))


class SlopeOptions(EffectOptions):
    """How friction turns over at zero speed."""

    slope_s_m: float = Field(
        default=900.0, gt=0, description="slope of Sf at rest; .inf is sign(v)"
    )
    sign_shape: Shape = Field(default="arctan", description="form of Sf")

    @property
    def sign(self) -> Sign:
        """Slope and shape together."""
        return Sign(self.slope_s_m, self.sign_shape)


def sign_of(effects: Iterable[Effect]) -> Sign | None:
    """Return how the first friction among effects turns over; None without friction."""
    signs = (e.options.sign for e in effects if isinstance(e.options, SlopeOptions))
    return next(signs, None)


def slope_of(effects: Iterable[Effect]) -> float | None:
    """Return the slope at rest [s/m] of the first friction among effects; None without friction."""
    sign = sign_of(effects)
    return None if sign is None else sign.slope_s_m


def with_sign(effect: Effect, sign: Sign | None) -> Effect:
    """Return an effect whose friction turns over so, where it has one and `sign` is given."""
    if sign is None or not isinstance(effect.options, SlopeOptions):
        return effect
    return effect.with_options(slope_s_m=sign.slope_s_m, sign_shape=sign.shape)


def with_slope(effect: Effect, slope_s_m: float | None) -> Effect:
    """Return an effect with this slope at rest [s/m], where it has one and one is given."""
    if slope_s_m is None or not isinstance(effect.options, SlopeOptions):
        return effect
    return effect.with_options(slope_s_m=slope_s_m)


@njit(inline="always")
def sf(v: float, slope: float, shape: float) -> float:
    """Return Sf(v), from -1 to 1, with s the slope.

    By its shape: (2/pi) arctan(s v) (Chen, Yao, Wang 2013), tanh(s v), s v/sqrt(1 + (s v)^2),
    s v/(1 + |s v|), or s v cut off at 1.
    """
    if v == 0.0:
        return 0.0
    y = slope * v
    if shape == 0.0:
        return 2.0 / math.pi * math.atan(y)
    if math.isinf(y):
        return math.copysign(1.0, v)
    if shape == 1.0:
        return math.tanh(y)
    if shape == 2.0:
        return y / math.sqrt(1.0 + y * y)
    if shape == 3.0:
        return y / (1.0 + abs(y))
    return min(1.0, max(-1.0, y))
