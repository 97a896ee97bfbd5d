"""Friction that depends on the direction of travel alone."""

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf


class CoulombFriction(Effect):
    """theta3 Sf(v) with Sf(v) = (2/pi) arctan(slope v)."""

    name = "coulomb_friction"
    kind = "state"
    title = "Coulomb friction"
    formula = "theta3 * Sf(v),  Sf(v) = (2/pi) arctan(slope v)"
    compensated = "feedforward with the sign function of the desired velocity"
    identified = "linear in Sf(v)"
    visible_in = "travel in both directions"
    groups = frozenset({"friction"})
    proportional_to = "direction"
    revealed_by = ("two_speeds",)
    Options = SlopeOptions
    options: SlopeOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta3 = Af / A1."""
        return (Parameter("", "theta3", "V", 0.0, 1e3, 0.1, 100.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Slope of Sf [s/m]."""
        return self.options.sign.constants


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return Sf of the velocity that is free of quantisation."""
    return sf(vs, c[0], c[1])
