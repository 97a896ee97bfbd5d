"""A seventh effect, as a user would add it: two parameters and a constant, one file."""

import math

from numba import njit
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter


class WaveOptions(EffectOptions):
    """How long a wave is."""

    pitch_m: float = Field(default=0.06, gt=0)


class SeventhEffect(Effect):
    """A force that waves along the travel."""

    name = "seventh_effect"
    kind = "state"
    title = "Wave along the travel"
    formula = "A sin(2 pi x/P) + B cos(2 pi x/P)"
    compensated = "feedforward at the desired position"
    identified = "linear in both amplitudes"
    visible_in = "travel over a pitch"
    Options = WaveOptions

    @property
    def parameters(self):
        """Both amplitudes."""
        return (
            Parameter("sin", "A", "V", -5.0, 5.0, 0.0, 1.0),
            Parameter("cos", "B", "V", -5.0, 5.0, 0.0, 1.0),
        )

    @property
    def constants(self):
        """The wave number [rad/m]."""
        return (2.0 * math.pi / self.options.pitch_m,)


@njit
def column(j, x, v, a, vs, t, c):
    """Return sine or cosine."""
    return math.sin(c[0] * x) if j == 0 else math.cos(c[0] * x)
