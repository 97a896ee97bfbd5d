"""An effect of one's own in the input map, with a part that differs between the directions."""

from numba import njit

from motorctl.model import Effect, Parameter


class OwnSaturation(Effect):
    """v(u) = u + theta_1 u|u| + theta_2 u^2."""

    name = "own_saturation"
    kind = "input"
    title = "Saturation of one's own"
    formula = "v(u) = u + q u|u| + s u^2"
    compensated = "inversion of the input map"
    identified = "linear in u|u| and u^2"
    visible_in = "commands of both signs"

    @property
    def parameters(self):
        """The part of both directions, and the difference between them."""
        return (
            Parameter("quadratic", "q", "1/V", -0.03, 0.0, 0.0, 0.05),
            Parameter("skew", "s", "1/V", -0.01, 0.01, 0.0, 0.01),
        )


@njit
def column(j, u, c):
    """Return u|u| or u^2."""
    return u * abs(u) if j == 0 else u * u


@njit
def slope(j, u, c):
    """Return its derivative."""
    return 2.0 * abs(u) if j == 0 else 2.0 * u
