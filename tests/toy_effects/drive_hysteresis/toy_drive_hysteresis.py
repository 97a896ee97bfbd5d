"""A drive stage with hysteresis: a part of the command comes only after some play."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans

Array = NDArray[np.float64]


class DriveHysteresisOptions(EffectOptions):
    """How far the command goes before the rest follows."""

    play_v: float = Field(gt=0, allow_inf_nan=False, description="half the width of the play")


class DriveHysteresis(Effect):
    """v(u) = u - q (u - p), p the play operator (Krasnosel'skii): |u - p| <= r."""

    name = "drive_hysteresis"
    kind = "input"
    memory = 1
    title = "Hysteresis of the drive stage"
    formula = "v(u) = u - q * (u - p),  p follows u with a play of r"
    compensated = "inversion of the input map from the present play"
    identified = "linear in q; the play r by a scan"
    visible_in = "commands that turn back often, by more than 2 r"
    revealed_by = ("fast_reversals",)
    Options = DriveHysteresisOptions
    options: DriveHysteresisOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """q."""
        return (Parameter("share", "q", "1", -0.9, 0.9, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """r [V]."""
        return (self.options.play_v,)

    @property
    def picture(self) -> Picture:
        """What acts for a command."""
        return Picture("acting_command", "What acts, for a command.", scale=self.options.play_v)

    def memories(self) -> Sequence[tuple[float, ...]]:
        """Return places of the play from end to end."""
        return [(float(place),) for place in np.linspace(-10.0, 10.0, 9)]

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return plays from a two-hundredth to half of the largest command."""
        if not spans.command_v > 0.0:
            return ()
        plays = spans.command_v * np.geomspace(0.005, 0.5, 14)
        return [cls(DriveHysteresisOptions(play_v=float(play))) for play in plays]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of the play."""
        return {"play_v": 0.2 * self.options.play_v}


@njit(inline="always")
def _play(u: float, p: float, r: float) -> float:
    return max(u - r, min(u + r, p))


@njit(inline="always")
def column(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return minus what the play keeps back."""
    return _play(u, w[0], c[0]) - u


@njit(inline="always")
def slope(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return its derivative: while in the play, nothing follows."""
    return -1.0 if abs(u - w[0]) < c[0] else 0.0


@njit
def advance(w: Array, u: float, dt: float, c: tuple[float, ...]) -> None:
    """Take the play along."""
    w[0] = _play(u, w[0], c[0])
