"""Friction that grows with the force that a gear, a screw or a guide carries."""

from __future__ import annotations

from numba import njit

from motorctl.model.effect import Effect, Parameter
from motorctl.model.knowledge import Picture
from motorctl.model.sign_function import SlopeOptions, sf


class LoadFriction(Effect):
    """mu |a| Sf(v): Coulomb friction in proportion to the force of inertia."""

    name = "load_friction"
    kind = "state"
    title = "Friction that grows with load"
    formula = "mu * |a| * Sf(v)"
    compensated = "feedforward at the desired acceleration and velocity"
    identified = "linear in |a| Sf(v)"
    visible_in = (
        "the same moves at two or more accelerations, speeding up and slowing down in both "
        "directions"
    )
    groups = frozenset({"friction"})
    revealed_by = ("two_accelerations",)
    Options = SlopeOptions
    options: SlopeOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Inertia times the part of its force that becomes friction."""
        return (Parameter("", "mu", "V*s^2/m", 0.0, 1e3, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Slope and shape of Sf."""
        return self.options.sign.constants

    @property
    def picture(self) -> Picture:
        """Friction against velocity."""
        return Picture("friction_over_velocity", "Friction against velocity: data and models.")


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return |a| Sf."""
    return abs(a) * sf(vs, c[0], c[1])
