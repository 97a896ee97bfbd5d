"""Friction that grows with the force that goes through a gear, a screw or a guide."""

from __future__ import annotations

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.knowledge import Picture
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf


class LoadFriction(Effect):
    """v(u) = u - mu |u| Sf(x'): Coulomb friction in proportion to the motor's own force.

    What speeds the mass up, what holds a weight and what overcomes the other friction all go
    through the same teeth; so it is the command that it grows with, not the acceleration alone.
    """

    name = "load_friction"
    kind = "input"
    varies = True
    varies_with_velocity = True
    title = "Friction that grows with load"
    formula = "v(u) = u - mu * |u| * Sf(x'),  x' the velocity"
    compensated = "inversion of the input map at the desired velocity"
    identified = "linear in |u| Sf(x')"
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
        """The part of the motor's force that is lost: one less its efficiency, driving."""
        return (Parameter("", "mu", "1", 0.0, 0.9, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Slope and shape of Sf."""
        return self.options.sign.constants

    @property
    def picture(self) -> Picture:
        """Friction against velocity."""
        return Picture("friction_over_velocity", "Friction against velocity: data and models.")


@njit(inline="always")
def column(j: int, u: float, x: float, vs: float, t: float, c: tuple[float, ...]) -> float:
    """Return -|u| Sf."""
    return -abs(u) * sf(vs, c[0], c[1])


@njit(inline="always")
def slope(j: int, u: float, x: float, vs: float, t: float, c: tuple[float, ...]) -> float:
    """Return its derivative; at rest, where it has a corner, that of its right side."""
    lost = sf(vs, c[0], c[1])
    return lost if u < 0.0 else -lost
