"""Friction that changes over the recording while grease and bearings warm up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import CarriedOver, Picture, Spans
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf

PER_DECADE = 6
"""Time constants that are tried, a decade. More takes time, fewer starts the refinement too far
away. Chosen by hand: each is about half as long again as the last."""


class WarmingFrictionOptions(SlopeOptions):
    """When and how fast it warms up."""

    time_constant_s: float = Field(
        ge=1e-6, allow_inf_nan=False, description="time constant of warming up"
    )
    begin_s: float = Field(
        default=0.0, allow_inf_nan=False, description="time at which it is still cold"
    )


class WarmingFriction(Effect):
    """exp(-(t - t_0)/tau) (F_w Sf(v) + B_w v): what a cold axis has more than a warm one."""

    name = "warming_friction"
    kind = "state"
    title = "Friction that falls as it warms up"
    formula = "exp(-(t - t_0)/tau) * (F_w Sf(v) + B_w v)"
    compensated = "the warm machine's friction as feedforward; the adaptation follows the rest"
    identified = "linear in F_w and B_w; time constant tau by a scan"
    visible_in = "the same motion repeated for at least a time constant, begun with a cold machine"
    groups = frozenset({"friction"})
    # far beyond the recording it is a straight line in time, far below a step at the beginning
    refuted_at_end = MappingProxyType({"time_constant_s": "neither"})
    revealed_by = ("longer_run",)
    told_by_other_speeds = True
    Options = WarmingFrictionOptions
    options: WarmingFrictionOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What Coulomb and viscous friction lose; negative where they grow."""
        return (
            Parameter("coulomb", "F_w", "V", -1e3, 1e3, 0.0, 1.0),
            Parameter("viscous", "B_w", "V*s/m", -1e4, 1e4, 0.0, 1.0),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """1/tau [1/s], t_0 [s], slope and shape of Sf."""
        return (
            1.0 / self.options.time_constant_s,
            self.options.begin_s,
            *self.options.sign.constants,
        )

    @property
    def picture(self) -> Picture:
        """Friction against velocity: a band, from the cold machine's to the warm one's."""
        return Picture(
            "friction_over_velocity",
            "Friction against velocity; while it warms up the data move from one edge of the band "
            "to the other.",
        )

    def carry_over(self, theta: Sequence[float], spans: Spans) -> CarriedOver:
        """Carry over the friction at the recording's end, not the time of warming up."""
        passed = max(spans.time_s[1] - self.options.begin_s, 0.0)
        left = math.exp(-passed / self.options.time_constant_s)
        return CarriedOver(
            kept=False,
            adds={"direction": left * theta[0], "velocity": left * theta[1]},
            note=(
                f"friction changed by {theta[0]:.3g} V and {theta[1]:.3g} V s/m with a time "
                f"constant of {self.options.time_constant_s:.3g} s: the parameters are those of "
                "the machine at the recording's end, and the adaptation follows from there"
            ),
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return time constants around the recording's duration, from its first sample."""
        low, high = max(0.1 * spans.duration_s, 1e-6), 3.0 * spans.duration_s
        return [
            cls(WarmingFrictionOptions(time_constant_s=time, begin_s=spans.time_s[0]))
            for time in log_grid(low, high, PER_DECADE)
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the time constant."""
        return {"time_constant_s": log_step(self.options.time_constant_s, PER_DECADE)}


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return what is left of the cold friction's direction, or velocity."""
    left = math.exp(-(t - c[1]) * c[0]) if t > c[1] else 1.0
    return left * (sf(vs, c[2], c[3]) if j == 0 else v)
