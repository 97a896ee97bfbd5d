"""Moving mass."""

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.parameter import Parameter


class Inertia(Effect):
    """theta1 a: the moving mass over the force constant."""

    name = "inertia"
    kind = "state"
    title = "Moving mass"
    formula = "theta1 * a"
    compensated = "feedforward of the desired acceleration"
    identified = "linear in acceleration; its reciprocal multiplies the command in a = b1 u + ..."
    visible_in = "accelerations well above the noise, of both signs"
    proportional_to = "acceleration"
    revealed_by = ("fast_reversals",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta1 = M / A1."""
        return (Parameter("", "theta1", "V*s^2/m", 1e-7, 1e3, 0.2, 2.0),)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the acceleration."""
    return a
