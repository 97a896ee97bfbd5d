"""A force of position that does not repeat: springs, cables, ends of the magnet way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from numba import njit
from pydantic import Field

from motorctl.model.bspline import (
    SHORTEST_M,
    Knots,
    basis,
    finer_knots,
    spline_constants,
    spline_parameters,
)
from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

SMOOTH_FUNCTIONS = 30
"""Basis functions over the travel for unknown structure. More follows noise and makes the tick
longer, fewer misses short structure. Chosen by hand: its 27 cells follow a wave a tenth of the
travel long."""


class PositionForceOptions(EffectOptions):
    """Shape of the force over position: a polynomial, or splines where knots are given."""

    center_m: float = Field(
        default=0.0, allow_inf_nan=False, description="where the polynomial is zero"
    )
    degree: Literal[1, 3] = Field(
        default=1, description="1: spring; 3: spring and cubic; unused with knots"
    )
    knots: Knots | None = Field(
        default=None, description="[from_m, to_m, functions]: cubic splines over this range"
    )


class PositionForce(Effect):
    """A function of position alone, without its mean, which is the offset's."""

    name = "position_force"
    kind = "state"
    title = "Force that depends on position"
    formula = "K_1 (x - c) + K_3 (x - c)^3, or sum of K_j B_j(x)"
    compensated = "feedforward at the desired position"
    identified = "linear in powers or splines of position; positive pulls back to the centre"
    visible_in = (
        "travel over the whole range in both directions, slow passes most of all: the part that "
        "changes sign with the direction is friction instead"
    )
    groups = frozenset({"force_of_position"})
    ordinary = True
    revealed_by = ("two_speeds",)
    told_by_other_speeds = True
    Options = PositionForceOptions
    options: PositionForceOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Spring and cubic stiffness, or one for each spline but the last."""
        if self.options.knots is not None:
            # all splines together are the offset
            return spline_parameters("K", self.options.knots[2])
        spring = Parameter("spring", "K_1", "V/m", -1e5, 1e5, 0.0, 10.0)
        cubic = Parameter("cubic", "K_3", "V/m^3", -1e9, 1e9, 0.0, 1e4)
        return (spring,) if self.options.degree == 1 else (spring, cubic)

    @property
    def constants(self) -> tuple[float, ...]:
        """Centre [m], and the splines' constants."""
        return self.options.center_m, *spline_constants(self.options.knots)

    @property
    def is_spline(self) -> bool:
        """Whether knots are given."""
        return self.options.knots is not None

    @property
    def picture(self) -> Picture:
        """Force against position."""
        return Picture(
            "force_over_position",
            "Command that works against a force of position alone; below, the residual.",
        )

    @classmethod
    def smooth_function(cls, variables: Sequence[str], spans: Spans) -> Effect | None:
        """Return splines over the travel for what depends on position alone."""
        if set(variables) != {"position"} or spans.travel_m < SHORTEST_M:
            return None
        return cls(PositionForceOptions(knots=(*spans.position_m, SMOOTH_FUNCTIONS)))

    @classmethod
    def over_place(cls, knots: tuple[float, float, int]) -> Effect | None:
        """Return splines over a range."""
        return cls(PositionForceOptions(knots=knots))

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return a spring around the middle of the travel, and any cubic polynomial."""
        if spans.travel_m < SHORTEST_M:
            return ()
        spring = cls(PositionForceOptions(center_m=sum(spans.position_m) / 2.0))
        return spring, spring.with_options(knots=(*spans.position_m, 4))

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the centre, where it is not the same as an offset."""
        cubic = self.options.knots is None and self.options.degree == 3
        return {"center_m": spans.travel_m / 8.0} if cubic and spans.travel_m >= SHORTEST_M else {}

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return the cubic spring and ever finer splines over the travel."""
        line = self.options.knots is None and self.options.degree == 1
        cubic = [self.with_options(degree=3)] if line else []
        finer = finer_knots(self.options.knots, spans)
        return [*cubic, *(self.with_options(knots=knots) for knots in finer)]


@njit
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the j-th power or spline; c[3] is the number of splines."""
    if c[3] > 0.0:
        return basis(j, x, c[1], c[2], c[3])
    d = x - c[0]
    return d if j == 0 else d * d * d
