"""Force constant that varies along the magnets."""

from __future__ import annotations

import math

from numba import njit

from motorctl.model.knowledge import Picture
from motorctl.model.parameter import Parameter
from motorctl.model.pitch import PitchWave


class ForceRipple(PitchWave):
    """v(u) = u (1 + sum of S_k sin(2 pi k x/P) + C_k cos(2 pi k x/P))."""

    name = "force_ripple"
    kind = "input"
    odd = True
    varies = True
    title = "Force ripple"
    formula = "v(u) = u * (1 + sum of S_k sin(2 pi k x/P) + C_k cos(2 pi k x/P))"
    compensated = "inversion of the input map at the present position"
    identified = "linear in command times sine and cosine; the pitch P by a scan of 1/P"
    visible_in = (
        "travel over at least one pitch, better several, at two different accelerations: "
        "a force that stays when the command does not is one of position alone"
    )
    groups = frozenset({"wave_over_position"})
    ordinary = True
    scan_shows_part = True
    revealed_by = ("two_accelerations",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """S_k and C_k of every order, together so small that the map keeps its inverse."""
        most = 0.5 / len(self.options.orders)
        return tuple(
            Parameter(f"{wave}_{k}", f"{wave[0].upper()}{k}", "1", -most, most, 0.0, 0.1)
            for k in self.options.orders
            for wave in ("sin", "cos")
        )

    @property
    def picture(self) -> Picture:
        """Thrust for a command along the way."""
        return Picture(
            "thrust_over_position",
            "Thrust for a command, against position: what everything else leaves, over the "
            "command.",
            scale=self.options.pitch_m,
        )


@njit(inline="always")
def column(j: int, u: float, x: float, t: float, c: tuple[float, ...]) -> float:
    """Return the command times sine or cosine."""
    angle = c[j >> 1] * x
    return u * math.sin(angle) if j & 1 == 0 else u * math.cos(angle)


@njit(inline="always")
def slope(j: int, u: float, x: float, t: float, c: tuple[float, ...]) -> float:
    """Return its derivative."""
    angle = c[j >> 1] * x
    return math.sin(angle) if j & 1 == 0 else math.cos(angle)
