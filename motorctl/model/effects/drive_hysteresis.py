"""A drive stage whose output depends on where its command came from: magnets, valves, piezos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

Array = NDArray[np.float64]

PER_DECADE = 6
"""Plays that are tried, a decade. More takes time, fewer start the refinement too far away. Chosen
by hand."""
SHORTEST, LONGEST = 0.01, 0.7
"""Plays that are tried, as parts of the largest command. Shorter ones are passed by every ripple of
the command and look like a delay; longer ones never pass, and are a gain; wider takes time. Chosen
by hand."""
MOST_PLAYS = 3
"""Plays that stand side by side, at most. More follow a rounder loop, and take up what is another
effect's; fewer leave more of a round loop. Chosen by hand."""
LARGEST_SHARE = 0.9
"""Of the command that waits for the plays: at one the map stands still where the command turns
back, and has no inverse; smaller refuses true stages. Arithmetic: the slope there is 1 - q, and a
tenth is left for the other parameters, as in a dead zone."""


class DriveHysteresisOptions(EffectOptions):
    """How wide the loop is, and how round."""

    play_v: float = Field(
        ge=1e-9, allow_inf_nan=False, description="r: half the width of the widest play"
    )
    plays: int = Field(
        default=1, ge=1, le=MOST_PLAYS, description="n: plays side by side, of r/n, 2r/n, ... r"
    )


class DriveHysteresis(Effect):
    """v(u) = u - sum over k of q_k (u - p_k), with p_k the play of u with |u - p_k| <= k r/n.

    A part of the command comes only once a play is passed: Prandtl and Ishlinskii's hysteresis
    (Krasnosel'skii, Pokrovskii 1989; Kuhnen 2003), on which magnetic, piezoelectric and hydraulic
    stages are modelled.
    """

    name = "drive_hysteresis"
    kind = "input"
    title = "Hysteresis of the drive stage"
    formula = "v(u) = u - sum_k q_k (u - p_k),  p_k follows u with a play of k r/n"
    compensated = "inversion of the input map from where the plays stand after the last command"
    identified = "linear in the shares q_k; the play r by a scan, more plays where they pay"
    visible_in = "commands that turn back often, by more than twice the play, at several levels"
    refuted_at_end = MappingProxyType({"play_v": "either"})
    revealed_by = ("fast_reversals", "two_accelerations")
    Options = DriveHysteresisOptions
    options: DriveHysteresisOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """q_k: a stage loses energy in its loop, and gives none."""
        n = self.options.plays
        return tuple(
            Parameter(f"share_{k}", f"q_{k}", "1", 0.0, LARGEST_SHARE / n, 0.0, 0.1)
            for k in range(1, n + 1)
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """The narrowest play r/n [V]."""
        return (self.options.play_v / self.options.plays,)

    @property
    def memory_size(self) -> int:
        """How far the command stands in each play, u - p_k [V], and the last command [V]."""
        return self.options.plays + 1

    @property
    def picture(self) -> Picture:
        """The command that acts."""
        return Picture(
            "acting_command",
            "Command that acts against command that is given, over the width of the loop.",
            scale=self.options.play_v,
        )

    def memories(self) -> Sequence[tuple[float, ...]]:
        """Return the command after a rise, a fall, and at rest.

        The column falls most steeply inside the plays; there it does so from every memory.
        """
        sides = (-1.0, 0.0, 1.0)
        widths = [self.constants[0] * (k + 1) for k in range(self.options.plays)]
        return [(*(side * width for width in widths), 0.0) for side in sides]

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return single plays from a hundredth of the largest command to most of it."""
        low, high = max(SHORTEST * spans.command_v, 1e-9), LONGEST * spans.command_v
        return [
            cls(DriveHysteresisOptions(play_v=play)) for play in log_grid(low, high, PER_DECADE)
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the play."""
        return {"play_v": log_step(self.options.play_v, PER_DECADE)}

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return one play more: a rounder loop."""
        more = self.options.plays + 1
        return [self.with_options(plays=more)] if more <= MOST_PLAYS else []


@njit(inline="always")
def _inside(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return where the command u stands in play j [V]: w[j] on, but not beyond its ends."""
    end = c[0] * (j + 1)
    return float(min(max(w[j] + (u - w[w.size - 1]), -end), end))


@njit(inline="always")
def column(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return minus the part of the command [V] that waits for play j."""
    return -_inside(j, u, w, c)


@njit(inline="always")
def slope(j: int, u: float, w: Array, c: tuple[float, ...]) -> float:
    """Return its derivative: inside the play nothing follows."""
    return -1.0 if abs(w[j] + (u - w[w.size - 1])) < c[0] * (j + 1) else 0.0


@njit
def advance(w: Array, u: float, dt: float, c: tuple[float, ...]) -> None:
    """Take the plays along to the command that acts."""
    for j in range(w.size - 1):
        w[j] = _inside(j, u, w, c)
    w[w.size - 1] = u
