"""Amplifier that does not answer, or answers less, to small commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

PER_DECADE = 8
"""Half widths that are tried, a decade. More takes time, fewer starts the refinement too far away.
Chosen by hand: each is about a third wider than the last."""
STEEPEST = 0.9
"""Depth over half width, at most. Nearer to one the inverse is so steep that the adaptation, which
keeps the map monotonic, has no room left for the other parameters; smaller cannot follow zones that
are nearly dead. Chosen by hand."""


class DeadZoneOptions(EffectOptions):
    """Where the dead zone ends."""

    half_width_v: float = Field(
        ge=1e-9, allow_inf_nan=False, description="command from which the amplifier answers fully"
    )


class DeadZone(Effect):
    """v(u) = u - delta clip(u/w, -1, 1): delta of the command is lost, all of it where delta = w.

    A zone that is fully dead has no inverse (Assumption 2), so delta stays below w.
    """

    name = "dead_zone"
    kind = "input"
    odd = True
    title = "Dead zone"
    formula = "v(u) = u - delta * clip(u/w, -1, 1)"
    compensated = "inversion of the input map: a step of 2 delta where the command changes sign"
    identified = "linear in the depth delta; the half width w by a scan"
    visible_in = "commands that pass zero often and slowly: gentle accelerations, slow travel"
    revealed_by = (
        "slow_reversals",
        "fast_reversals",
    )
    Options = DeadZoneOptions
    options: DeadZoneOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """delta: what the zone takes from a command beyond it."""
        deepest = STEEPEST * self.options.half_width_v
        return (Parameter("depth", "delta", "V", 0.0, deepest, 0.0, 1.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Half width [V] and its reciprocal [1/V]."""
        return self.options.half_width_v, 1.0 / self.options.half_width_v

    @property
    def picture(self) -> Picture:
        """The command that acts, near zero."""
        return Picture(
            "acting_command",
            "Command that acts against command that is given, near zero.",
            scale=self.options.half_width_v,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return half widths from a two-thousandth to a tenth of the largest command."""
        low, high = max(5e-4 * spans.command_v, 1e-9), 0.1 * spans.command_v
        return [
            cls(DeadZoneOptions(half_width_v=width)) for width in log_grid(low, high, PER_DECADE)
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the half width."""
        return {"half_width_v": log_step(self.options.half_width_v, PER_DECADE)}


@njit(inline="always")
def column(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return -clip(u/w, -1, 1)."""
    return -min(max(u * c[1], -1.0), 1.0)


@njit(inline="always")
def slope(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    return -c[1] if abs(u) < c[0] else 0.0
