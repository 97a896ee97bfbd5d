"""A constant force: amplifier offset, slope of the machine, cable pull."""

from numba import njit

from motorctl.model.effect import Effect
from motorctl.model.parameter import Parameter


class Offset(Effect):
    """Theta4 on the side of the command: u = ... - theta4."""

    name = "offset"
    kind = "state"
    title = "Constant force"
    formula = "-theta4"
    compensated = "feedforward of its negative"
    identified = "linear in a constant"
    visible_in = "any motion in both directions"
    proportional_to = "one"
    load_sign = -1.0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """theta4 = Fdis,nominal / A1."""
        return (Parameter("", "theta4", "V", -1e3, 1e3, 0.0, 500.0),)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return minus one."""
    return -1.0
