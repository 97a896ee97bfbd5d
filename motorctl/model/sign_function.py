"""The sign function Sf of friction, and how steep it is."""

import math

from numba import njit
from pydantic import Field

from motorctl.model.effect import EffectOptions


class SlopeOptions(EffectOptions):
    """How steeply friction turns over at zero speed."""

    slope_s_m: float = Field(
        default=900.0, gt=0, description="slope of Sf at rest; .inf is sign(v)"
    )


@njit(inline="always")
def sf(v: float, slope: float) -> float:
    """Give Sf(v) = (2/pi) arctan(slope v) (Chen, Yao, Wang 2013)."""
    if v == 0.0:
        return 0.0
    return 2.0 / math.pi * math.atan(slope * v)
