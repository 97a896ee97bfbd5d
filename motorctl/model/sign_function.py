"""The sign function Sf of friction, and how steep it is."""

from __future__ import annotations

import math
from collections.abc import Iterable

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions


class SlopeOptions(EffectOptions):
    """How steeply friction turns over at zero speed."""

    slope_s_m: float = Field(
        default=900.0, gt=0, description="slope of Sf at rest; .inf is sign(v)"
    )


def slope_of(effects: Iterable[Effect]) -> float | None:
    """Return the slope at rest [s/m] of the first friction among effects; None without friction."""
    slopes = (e.options.slope_s_m for e in effects if isinstance(e.options, SlopeOptions))
    return next(slopes, None)


def with_slope(effect: Effect, slope_s_m: float | None) -> Effect:
    """Return an effect with this slope at rest [s/m], where it has one and one is given."""
    if slope_s_m is None or not isinstance(effect.options, SlopeOptions):
        return effect
    return effect.with_options(slope_s_m=slope_s_m)


@njit(inline="always")
def sf(v: float, slope: float) -> float:
    """Return Sf(v) = (2/pi) arctan(slope v) (Chen, Yao, Wang 2013)."""
    if v == 0.0:
        return 0.0
    return 2.0 / math.pi * math.atan(slope * v)
