"""An effect of one's own with two parameters and an option, as a user would write it."""

import math

from numba import njit

from motorctl.model import Effect, EffectOptions, Parameter


class RippleOptions(EffectOptions):
    """The pitch of the magnets."""

    pitch_m: float = 0.06


class Ripple(Effect):
    """A force periodic in position."""

    name = "ripple"
    kind = "state"
    title = "Ripple"
    formula = "A sin(2 pi x / pitch) + B cos(2 pi x / pitch)"
    compensated = "feedforward"
    identified = "linear in both amplitudes"
    visible_in = "travel over a pitch"
    Options = RippleOptions

    @property
    def parameters(self):
        """Two amplitudes."""
        return (
            Parameter("sin", "A", "V", -10.0, 10.0, 0.0, 1.0),
            Parameter("cos", "B", "V", -10.0, 10.0, 0.0, 1.0),
        )

    @property
    def constants(self):
        """The pitch."""
        return (self.options.pitch_m,)


@njit(inline="always")
def column(j, x, v, a, vs, t, c):
    """Return sine or cosine."""
    angle = 2.0 * math.pi * x / c[0]
    return math.sin(angle) if j == 0 else math.cos(angle)
