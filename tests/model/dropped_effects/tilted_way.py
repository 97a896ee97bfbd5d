"""An effect that is found because its file lies in the folder of effects."""

from numba import njit

from motorctl.model import Effect, Parameter


class TiltedWay(Effect):
    """A spring towards the origin."""

    name = "tilted_way"
    kind = "state"
    title = "Force that grows along the way"
    formula = "k x"
    compensated = "feedforward at the desired position"
    identified = "linear in position"
    visible_in = "travel"

    @property
    def parameters(self):
        """The stiffness."""
        return (Parameter("", "k", "V/m", -10.0, 10.0, 0.0, 10.0),)


@njit
def column(j, x, v, a, vs, t, c):
    """Return the position."""
    return x
