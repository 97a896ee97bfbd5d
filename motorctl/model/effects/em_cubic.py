"""Electromagnetic nonlinearity of an iron-core motor: the part cubic in the command."""

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.parameter import Parameter


class EmCubic(Effect):
    """theta6 u^3 in the input map."""

    name = "em_cubic"
    kind = "input"
    electromagnetic = True
    odd = True
    title = "Magnetic saturation, cubic part"
    formula = "v(u) = u + theta6 * u^3"
    compensated = "inversion of the input map"
    identified = "linear in u^3, nearly collinear with the quadratic part: judge the map as a whole"
    visible_in = "commands up to the range that is to be known"
    revealed_by = ("fast_reversals",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta6 = A3 / A1."""
        return (Parameter("", "theta6", "1/V^2", -0.1, 0.1, 0.0, 0.005),)


@njit(inline="always")
def column(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return u^3."""
    return u * u * u


@njit(inline="always")
def slope(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    return 3.0 * u * u
