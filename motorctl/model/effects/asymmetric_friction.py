"""Friction that differs between the directions of travel."""

from __future__ import annotations

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.knowledge import Picture
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf


class AsymmetricFriction(Effect):
    """Half the difference of both directions, Coulomb and viscous."""

    name = "asymmetric_friction"
    kind = "state"
    title = "Asymmetric friction"
    formula = "F_a * |Sf(v)| + B_a * |v|"
    compensated = "feedforward at the desired velocity"
    identified = "linear in |Sf(v)| and |v|; |Sf(v)| differs from a constant only where it rests"
    visible_in = (
        "travel in both directions at two or more different speeds, with rests or slow "
        "reversals between, which tell it from a constant force"
    )
    groups = frozenset({"friction"})
    ordinary = True
    revealed_by = ("two_speeds",)
    Options = SlopeOptions
    options: SlopeOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Positive: the positive direction has more."""
        return (
            Parameter("coulomb", "F_a", "V", -1e3, 1e3, 0.0, 1.0),
            Parameter("viscous", "B_a", "V*s/m", -1e4, 1e4, 0.0, 1.0),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """Slope of Sf [s/m]."""
        return self.options.sign.constants

    @property
    def picture(self) -> Picture:
        """Friction against velocity."""
        return Picture("friction_over_velocity", "Friction against velocity: data and models.")


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return |Sf| or |v|."""
    return abs(sf(vs, c[0], c[1])) if j == 0 else abs(v)
