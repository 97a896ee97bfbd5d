"""Friction that varies over the travel: preload, wear, lubrication, seals."""

from __future__ import annotations

from collections.abc import Sequence
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
from motorctl.model.effect import Effect
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf


class PositionFrictionOptions(SlopeOptions):
    """Shape of the friction over position: a polynomial, or splines where knots are given."""

    center_m: float = Field(
        default=0.0, allow_inf_nan=False, description="where the polynomial is zero"
    )
    degree: Literal[1, 2] = Field(default=1, description="of the polynomial; unused with knots")
    knots: Knots | None = Field(
        default=None, description="[from_m, to_m, functions]: cubic splines over this range"
    )


class PositionDependentFriction(Effect):
    """Sf(v) times a function of position without its mean, which is Coulomb friction's."""

    name = "position_dependent_friction"
    kind = "state"
    title = "Friction that depends on position"
    formula = "Sf(v) * (F_1 (x - c) + F_2 (x - c)^2), or Sf(v) * sum of F_j B_j(x)"
    compensated = "feedforward at the desired position and velocity"
    identified = "linear in Sf(v) times powers or splines of position"
    visible_in = (
        "travel over the whole range in both directions, each place passed both ways: the part "
        "that keeps its sign is a force of position instead"
    )
    groups = frozenset({"friction", "friction_of_position"})
    ordinary = True
    revealed_by = ("two_speeds",)
    told_by_other_speeds = True
    Options = PositionFrictionOptions
    options: PositionFrictionOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """One for each power, or for each spline but the last."""
        if self.options.knots is not None:
            # all splines together are Coulomb friction
            return spline_parameters("F", self.options.knots[2])
        powers = (
            Parameter("linear", "F_1", "V/m", -1e5, 1e5, 0.0, 10.0),
            Parameter("quadratic", "F_2", "V/m^2", -1e7, 1e7, 0.0, 100.0),
        )
        return powers[: self.options.degree]

    @property
    def constants(self) -> tuple[float, ...]:
        """Slope of Sf [s/m], centre [m], and the splines' constants."""
        options = self.options
        return *options.sign.constants, options.center_m, *spline_constants(options.knots)

    @property
    def is_spline(self) -> bool:
        """Whether knots are given."""
        return self.options.knots is not None

    @property
    def picture(self) -> Picture:
        """Friction against position."""
        return Picture(
            "friction_over_position",
            "Level of friction without its viscous part, against position.",
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return the straight line and the parabola around the middle of the travel."""
        if spans.travel_m < SHORTEST_M:
            return ()
        middle = sum(spans.position_m) / 2.0
        line = cls(PositionFrictionOptions(center_m=middle))
        return line, line.with_options(degree=2)

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return the parabola and ever finer splines over the travel."""
        line = self.options.knots is None and self.options.degree == 1
        parabola = [self.with_options(degree=2)] if line else []
        finer = finer_knots(self.options.knots, spans)
        return [*parabola, *(self.with_options(knots=knots) for knots in finer)]


@njit
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return Sf times the j-th power or spline; c[5] is the number of splines."""
    if c[5] > 0.0:
        return sf(vs, c[0], c[1]) * basis(j, x, c[3], c[4], c[5])
    d = x - c[2]
    return sf(vs, c[0], c[1]) * (d if j == 0 else d * d)
