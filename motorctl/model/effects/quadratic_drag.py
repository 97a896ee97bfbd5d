"""Drag that grows with the square of the speed."""

from __future__ import annotations

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.knowledge import Picture
from motorctl.model.parameter import Parameter


class QuadraticDrag(Effect):
    """C_d v|v|."""

    name = "quadratic_drag"
    kind = "state"
    title = "Quadratic drag"
    formula = "C_d * v|v|"
    compensated = "feedforward at the desired velocity"
    identified = "linear in v|v|"
    visible_in = "travel at three or more different speeds up to the highest, in both directions"
    groups = frozenset({"friction"})
    ordinary = True
    revealed_by = ("two_speeds",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """C_d: negative where viscous friction weakens with speed, as eddy currents do."""
        return (Parameter("", "C_d", "V*s^2/m^2", -1e4, 1e4, 0.0, 1.0),)

    @property
    def picture(self) -> Picture:
        """Friction against velocity."""
        return Picture("friction_over_velocity", "Friction against velocity: data and models.")


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return v|v|."""
    return v * abs(v)
