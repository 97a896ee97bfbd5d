"""Electromagnetic nonlinearity of an iron-core motor: the part quadratic in the command."""

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.parameter import Parameter


class EmQuadratic(Effect):
    """theta5 u|u| in the input map."""

    name = "em_quadratic"
    kind = "input"
    electromagnetic = True
    odd = True
    title = "Magnetic saturation, quadratic part"
    formula = "v(u) = u + theta5 * u|u|"
    compensated = "inversion of the input map"
    identified = "linear in u|u|, nearly collinear with the cubic part: judge the map as a whole"
    visible_in = "commands up to the range that is to be known"
    revealed_by = ("fast_reversals",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta5 = A2 / A1."""
        return (Parameter("", "theta5", "1/V", -1.0, 1.0, 0.0, 0.05),)


@njit(inline="always")
def column(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return u|u|."""
    return u * abs(u)


@njit(inline="always")
def slope(j: int, u: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    return 2.0 * abs(u)
