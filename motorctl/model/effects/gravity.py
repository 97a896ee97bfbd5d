"""Weight of a joint's arm: a sine of the angle. A lift's weight is the offset."""

from __future__ import annotations

import math
from collections.abc import Sequence

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

IN_DEGREES = 360.0
"""One turn of an arm whose angle was recorded in degrees. Larger or smaller is another unit.
Arithmetic."""
LEAST_TURN = 0.03
"""Part of a turn that the arm has to move for its weight to be tried. Smaller tries a sine that is
no other than a straight line, larger misses arms that turn but little. Chosen by hand: over it a
sine leaves its chord by 0.4 % of its amplitude at most."""


class GravityOptions(EffectOptions):
    """How far the axis moves while the arm turns once."""

    turn_m: float = Field(
        default=2.0 * math.pi,
        ge=1e-9,
        allow_inf_nan=False,
        description="one turn of the arm in the position's unit: 2 pi where that is rad",
    )


class Gravity(Effect):
    """G_s sin(2 pi x/turn) + G_c cos(2 pi x/turn), for any direction of the arm at x = 0."""

    name = "gravity"
    kind = "state"
    title = "Gravity on an arm"
    formula = "G_s sin(2 pi x/turn) + G_c cos(2 pi x/turn)"
    compensated = "feedforward of its negative at the desired angle"
    identified = "linear in sine and cosine of the angle"
    visible_in = "slow travel in both directions over as much of a turn as the arm can do"
    groups = frozenset({"force_of_position"})
    revealed_by = ("two_speeds",)
    Options = GravityOptions
    options: GravityOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Sine and cosine: together the arm's weight times its lever, and where it hangs."""
        return (
            Parameter("sin", "G_s", "V", -1e3, 1e3, 0.0, 1.0),
            Parameter("cos", "G_c", "V", -1e3, 1e3, 0.0, 1.0),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """Wave number [rad/m]."""
        return (2.0 * math.pi / self.options.turn_m,)

    @property
    def remark(self) -> str:
        """Degrees that were declared as radians look like an arm of 360 rad a turn."""
        if self.options.turn_m != IN_DEGREES:
            return ""
        return (
            "its arm turns once in 360 of the position's unit, as where degrees are declared as "
            "radians: then state unit: deg, or inertia and viscous friction are 57.3 times too "
            "small. Behind a gear of about 57 to 1 it is right"
        )

    @property
    def picture(self) -> Picture:
        """Force against position."""
        return Picture(
            "force_over_position",
            "Command that works against the weight, over the angle; below, the residual.",
            scale=self.options.turn_m,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return the arm itself where the position is an angle that tells a sine from a line."""
        usual = GravityOptions().turn_m
        turns = [turn for turn in (usual, IN_DEGREES) if spans.travel_m > LEAST_TURN * turn]
        return [cls(GravityOptions(turn_m=turn)) for turn in turns] if spans.rotary else ()


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return sine or cosine of the angle."""
    return math.sin(c[0] * x) if j == 0 else math.cos(c[0] * x)
