"""A current loop known by its corner frequency: a lag, and the dead time of its converter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import Field

from motorctl.model import Effect, EffectOptions, Parameter, Picture, Spans

DEAD_PART = 0.3
"""Dead time in periods of the corner frequency."""


class CurrentLoopOptions(EffectOptions):
    """How fast the loop is."""

    corner_hz: float = Field(ge=1.0, le=1e5, description="corner frequency of the current loop")


class CurrentLoop(Effect):
    """A lag of 1/(2 pi f) behind a dead time of 0.3/f."""

    name = "current_loop"
    kind = "command"
    title = "Current loop"
    formula = "i' = 2 pi f (u(t - 0.3/f) - i)"
    compensated = "lead of the model's command by lag and dead time"
    identified = "its corner frequency f by a scan, its gain tied to the command's"
    visible_in = "high jerk"
    groups = frozenset({"command_timing"})
    revealed_by = ("fast_reversals",)
    Options = CurrentLoopOptions
    options: CurrentLoopOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the corner frequency is an option."""
        return ()

    @property
    def lag_s(self) -> float:
        """1/(2 pi f)."""
        return 1.0 / (2.0 * math.pi * self.options.corner_hz)

    @property
    def delay_s(self) -> float:
        """Dead time."""
        return DEAD_PART / self.options.corner_hz

    @property
    def picture(self) -> Picture:
        """Response from the command that was given to the one that acts."""
        return Picture("command_response", "Gain and phase of the current loop.")

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return corner frequencies from 50 Hz to 5 kHz."""
        corners = np.geomspace(50.0, 5e3, 20)
        return [cls(CurrentLoopOptions(corner_hz=float(corner))) for corner in corners]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Return a first step of the frequency."""
        return {"corner_hz": 0.2 * self.options.corner_hz}
