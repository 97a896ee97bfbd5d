"""Friction proportional to velocity, eddy currents and back electromotive force included."""

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.parameter import Parameter


class ViscousFriction(Effect):
    """theta2 v."""

    name = "viscous_friction"
    kind = "state"
    title = "Viscous friction"
    formula = "theta2 * v"
    compensated = "feedforward of the desired velocity"
    identified = "linear in velocity"
    visible_in = "travel at two or more different speeds"
    groups = frozenset({"friction"})
    proportional_to = "velocity"
    revealed_by = ("two_speeds",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta2 = B / A1."""
        return (Parameter("", "theta2", "V*s/m", 0.0, 1e4, 0.2, 50.0),)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the velocity."""
    return v
