"""Friction that depends on the direction of travel alone."""

import math

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions, Parameter


class CoulombOptions(EffectOptions):
    """How steeply the friction turns over at zero speed."""

    slope_s_m: float = Field(
        default=900.0, gt=0, description="slope of Sf at rest; .inf is sign(v)"
    )


class CoulombFriction(Effect):
    """theta3 Sf(v) with Sf(v) = (2/pi) arctan(slope v)."""

    name = "coulomb_friction"
    kind = "state"
    title = "Coulomb friction"
    formula = "theta3 * Sf(v),  Sf(v) = (2/pi) arctan(slope v)"
    compensated = "feedforward with the sign function of the desired velocity"
    identified = "linear in Sf(v)"
    visible_in = "travel in both directions"
    Options = CoulombOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta3 = Af / A1."""
        return (Parameter("", "theta3", "V", 0.0, 1e3, 0.1, 100.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Slope of Sf [s/m]."""
        assert isinstance(self.options, CoulombOptions)
        return (self.options.slope_s_m,)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Give Sf of the velocity that is free of quantisation."""
    if vs == 0.0:
        return 0.0
    return 2.0 / math.pi * math.atan(c[0] * vs)
