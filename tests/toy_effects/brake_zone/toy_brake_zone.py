"""A magnet beside the way brakes the carriage on a part of the travel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans

EDGE_M = 2e-3


class BrakeZoneOptions(EffectOptions):
    """Where the magnet stands."""

    middle_m: float = Field(allow_inf_nan=False, description="middle of the zone")
    half_length_m: float = Field(gt=0, allow_inf_nan=False, description="half its length")


class BrakeZone(Effect):
    """c v while the carriage is in the zone."""

    name = "brake_zone"
    kind = "state"
    title = "Brake on a part of the travel"
    formula = "c * v,  |x - x_0| < l"
    compensated = "feedforward at the desired motion"
    identified = "linear in c; middle and length of the zone by a scan"
    visible_in = "fast moves in and beside the zone"
    groups = frozenset({"friction"})
    revealed_by = ("two_speeds",)
    Options = BrakeZoneOptions
    options: BrakeZoneOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """c."""
        return (Parameter("", "c", "V*s/m", -1e3, 1e3, 0.0, 1.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """x_0 and l [m]."""
        return self.options.middle_m, self.options.half_length_m

    @property
    def picture(self) -> Picture:
        """Over the travel."""
        return Picture("friction_over_position", "Friction over the travel.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return zones of three lengths all over the travel."""
        if not spans.travel_m > 0.0:
            return ()
        low, high = spans.position_m
        return [
            cls(BrakeZoneOptions(middle_m=float(middle), half_length_m=share * spans.travel_m))
            for share in (0.06, 0.12, 0.2)
            for middle in np.linspace(low, high, 17)[1:-1]
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of both."""
        return {"middle_m": 0.03 * spans.travel_m, "half_length_m": 0.03 * spans.travel_m}


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the speed in the zone, which ends within some millimetres."""
    inside = (c[1] - abs(x - c[0])) / EDGE_M
    return v * min(max(0.5 + inside, 0.0), 1.0)
