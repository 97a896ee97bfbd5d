"""Force constant that varies along the magnets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from numba import njit

from motorctl.model.effect import Effect, Parameter
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.pitch import (
    TYPICAL_PITCHES,
    PitchOptions,
    pitch_constants,
    pitch_steps,
    richer_pitches,
    trial_pitches,
)


class ForceRipple(Effect):
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
    Options = PitchOptions
    options: PitchOptions

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
    def constants(self) -> tuple[float, ...]:
        """Wave number of every order [rad/m]."""
        return pitch_constants(self.options)

    @property
    def lines(self) -> tuple[float, ...]:
        """Wave number of every order [1/m]."""
        return tuple(order / self.options.pitch_m for order in self.options.orders)

    @property
    def repeats_every(self) -> float:
        """The pitch [m]."""
        return self.options.pitch_m

    @property
    def picture(self) -> Picture:
        """Thrust for a command along the way."""
        return Picture(
            "thrust_over_position",
            "Thrust for a command, against position: what everything else leaves, over the "
            "command.",
            scale=self.options.pitch_m,
        )

    @classmethod
    def typical(cls, spans: Spans) -> Effect | None:
        """Return a wave that repeats a dozen times over the travel."""
        return cls(PitchOptions(pitch_m=spans.travel_m / TYPICAL_PITCHES))

    @classmethod
    def at_line(cls, line: float) -> Effect:
        """Return one order of this wave number [1/m]."""
        return cls(PitchOptions(pitch_m=1.0 / line))

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return one order at every pitch that the travel can tell from the next."""
        return [cls(PitchOptions(pitch_m=pitch)) for pitch in trial_pitches(spans)]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the pitch."""
        return pitch_steps(self.options, spans)

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return one order more."""
        return [type(self)(options) for options in richer_pitches(self.options, spans)]


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
