"""Force between the iron core and the magnets, or once a turn of a screw: periodic in position."""

from __future__ import annotations

import math

from numba import njit

from motorctl.model.knowledge import Picture
from motorctl.model.parameter import Parameter
from motorctl.model.pitch import PitchWave


class Cogging(PitchWave):
    """A force on the carriage, sum of S_k sin(2 pi k x/P) + C_k cos(2 pi k x/P)."""

    name = "cogging"
    kind = "state"
    title = "Cogging"
    formula = "-sum of S_k sin(2 pi k x/P) + C_k cos(2 pi k x/P)"
    compensated = "feedforward of its negative at the desired position"
    identified = "linear in sine and cosine of each order; the pitch P by a scan of 1/P"
    visible_in = (
        "travel over at least one pitch, better several, at two different accelerations: "
        "a force that grows with the command is force ripple instead"
    )
    groups = frozenset({"force_of_position", "wave_over_position"})
    ordinary = True
    scan_shows_part = True
    revealed_by = ("two_speeds",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """S_k and C_k of every order."""
        return tuple(
            Parameter(f"{wave}_{k}", f"{wave[0].upper()}{k}", "V", -1e3, 1e3, 0.0, 1.0)
            for k in self.options.orders
            for wave in ("sin", "cos")
        )

    @property
    def picture(self) -> Picture:
        """Data and model over one pitch, and the spectrum along the way."""
        return Picture(
            "folded_over_pitch",
            "Force on the carriage that everything else leaves, against position, folded over one "
            "pitch, and the residual's spectrum along the way.",
            scale=self.options.pitch_m,
        )


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return minus the sine or the cosine: the command makes up for what pushes the carriage."""
    angle = c[j >> 1] * x
    return -math.sin(angle) if j & 1 == 0 else -math.cos(angle)
