"""Force constant that falls (or rises) while the motor and its amplifier warm up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import CarriedOver, Picture, Spans
from motorctl.model.parameter import Parameter

PER_DECADE = 8
"""Time constants that are tried, a decade. More takes time, fewer starts the refinement too far
away. Chosen by hand: each is about a third longer than the last."""


class GainDriftOptions(EffectOptions):
    """When and how fast the motor warms up."""

    time_constant_s: float = Field(
        ge=1e-6, allow_inf_nan=False, description="thermal time constant"
    )
    begin_s: float = Field(
        default=0.0, allow_inf_nan=False, description="time at which the gain is the full one"
    )


class GainDrift(Effect):
    """v(u) = u (1 - A (1 - exp(-(t - t_0)/tau)))."""

    name = "gain_drift"
    kind = "input"
    odd = True
    varies = True
    title = "Gain that drifts as it warms up"
    formula = "v(u) = u * (1 - A (1 - exp(-(t - t_0)/tau))),  t > t_0"
    compensated = "inversion of the input map at the present time"
    identified = "linear in the lost fraction A; time constant tau by a scan"
    visible_in = (
        "the same motion repeated for at least a time constant (minutes), with accelerations "
        "that make large commands"
    )
    # far beyond the recording it is a straight line in time, far below a step at the beginning
    refuted_at_end = MappingProxyType({"time_constant_s": "neither"})
    revealed_by = ("longer_run",)
    Options = GainDriftOptions
    options: GainDriftOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """A: the fraction of the gain that is lost in the end."""
        return (Parameter("fraction", "A", "1", -0.9, 0.9, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """1/tau [1/s] and t_0 [s]."""
        return 1.0 / self.options.time_constant_s, self.options.begin_s

    @property
    def picture(self) -> Picture:
        """Thrust for a command over time."""
        return Picture("gain_over_time", "Thrust for a command, against time.")

    def carry_over(self, theta: Sequence[float], spans: Spans) -> CarriedOver:
        """Carry over the gain that the warm motor has at the end, not the time of warming up."""
        most = self.parameters[0].upper
        lost = min(theta[0], most) * -math.expm1(
            -max(spans.time_s[1] - self.options.begin_s, 0.0) / self.options.time_constant_s
        )
        return CarriedOver(
            kept=False,
            scale=1.0 / (1.0 - lost),
            note=(
                f"the motor lost {100.0 * lost:.2g} % of its thrust while it warmed up in this "
                "recording: the parameters are those of the warm machine at its end, and the "
                "adaptation follows from there; the time of the recording is no time of the daemon"
            ),
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return time constants around the recording's duration, from its first sample."""
        low, high = max(0.1 * spans.duration_s, 1e-6), 3.0 * spans.duration_s
        return [
            cls(GainDriftOptions(time_constant_s=time, begin_s=spans.time_s[0]))
            for time in log_grid(low, high, PER_DECADE)
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the time constant; another beginning is the same as another gain."""
        return {"time_constant_s": log_step(self.options.time_constant_s, PER_DECADE)}


@njit(inline="always")
def _lost(t: float, c: tuple[float, ...]) -> float:
    return -math.expm1(-(t - c[1]) * c[0]) if t > c[1] else 0.0


@njit(inline="always")
def column(j: int, u: float, x: float, t: float, c: tuple[float, ...]) -> float:
    """Return minus the command times the part of the drift that has happened."""
    return -u * _lost(t, c)


@njit(inline="always")
def slope(j: int, u: float, x: float, t: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    return -_lost(t, c)
