"""Other models take axes over between two ticks, without a bump of their commands.

The tick that runs hands over to one that was made for the same machine with other models: compiled,
its records filled, nothing of it run. They share drivers, states and memory; only the laws change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import unpacked
from motorctl.loop.other_models import OtherModels, take_over_arguments
from motorctl.loop.states import OFF, State
from motorctl.loop.tick import Tick

SAFELY_OFF = (*OFF, State.FAULT)
"""States in which an axis has no command that could jump."""
WINDOW = ("following_error_minimum_m", "following_error_per_velocity_s")
"""Settings that say how large a following error may be."""
LEARNED = ("theta", "U", "D")
"""What of a law's state the adaptation has learned."""


@dataclass
class Outcome:
    """What came of a succession, once `done`."""

    done: bool = False
    refused: str | None = None
    """Why the old models go on; None: the new ones run."""


class Succession:
    """One hand-over, from the tick that runs to its successor.

    It is called between two ticks, in the thread that ticks; making it takes some milliseconds, and
    may be done in another one.

    Parameters
    ----------
    before
        The tick that runs, or that ran before the last succession.
    models
        What takes over.
    windows
        The part of its limits of following error that each axis has from then on, in the machine's
        order; none: all of them.

    Raises
    ------
    RunError
        Where the models were made for another loop.
    """

    def __init__(self, before: Tick, models: OtherModels, windows: Sequence[float] = ()) -> None:
        self.outcome = Outcome()
        self._models = models
        self._before = before
        self._made = models.settings()
        laws = models.laws(before.memory.layout["parameters"])
        settings = _settings(before, models, self._made, windows)
        self._after = before.with_other_models(settings, *laws, models.tick)
        self._holding = np.zeros(len(before.axes), np.bool_)
        self._arguments = take_over_arguments(before, self._after, self._holding)
        self._take_over = unpacked(models.take_over, *self._arguments, 1, 0.0)
        self._status = before.memory.status
        self._learned_rows = before.memory.learned["models_row"]
        self._carried = [i for i in range(len(before.axes)) if i not in models.axes]

    def __call__(self, number: int) -> Tick:
        """Return the tick that goes on with tick `number`; `outcome` tells which one it is."""
        before, after = self._before, self._after
        before.successor = None
        refused = self._not_standing() or self._not_taken_over(number - 1)
        self.outcome.refused = refused
        if refused is None:
            after.go_on()
            self._change_row()
        self.outcome.done = True
        return before if refused else after

    def _change_row(self) -> None:
        """Note from which row on the new models run, and what was learned with those that stay."""
        row, head = self._status["models_row"], self._status["ring_head"]
        for axis in self._carried:
            for slot in (0, 1):
                if self._learned_rows[axis, slot] == row[0]:
                    self._learned_rows[axis, slot] = head[0]
        self._status["models_row_before"] = row
        row[0] = head[0]

    def set_windows(self, windows: Sequence[float]) -> None:
        """Let each axis have this part of its limits of following error."""
        for field in WINDOW:
            self._after.settings[field] = self._made[field] * np.array(windows)

    @property
    def after(self) -> Tick:
        """The tick that takes over."""
        return self._after

    def _not_standing(self) -> str | None:
        """Return which of the axes is in no state for it; None: they are off, or hold."""
        for name, i in zip(self._models.names, self._models.axes, strict=True):
            axis = self._before.axes[i]
            state = State(int(axis["state"]))
            holds = (
                state == State.HOLDING
                and not axis["excitation_ticks"]
                and not axis["held_ticks"]
                and not axis["gap_ticks"]
                and not axis["fresh"]
            )
            if not (holds or state in SAFELY_OFF):
                return f"axis {name} neither holds nor is off"
            self._holding[i] = holds
        return None

    def _not_taken_over(self, tick: int) -> str | None:
        """Carry the laws on; return which axis' new one cannot give the present command."""
        before, after = self._before, self._after
        for i in self._carried:
            _carry_on(before.laws, after.laws, i)
        for i in self._models.learned_stays:
            for field in LEARNED:
                after.laws[field][i] = before.laws[field][i]
        refused = self._take_over(*self._arguments, tick, tick * before.machine.period_s)
        if refused < 0:
            return None
        name, law = list(before.machine.axes)[refused], before.laws[refused]
        units = before.machine.axes[name].units
        off = units.words(f"{1e3 * (law['y1'] - law['xd1']):.3g} mm")
        return (
            f"axis {name}: it holds with {law['u']:.3g} V, {off} off its position; to go on from "
            "there the new model needs more than its gains.d_hat_max_v "
            f"{after.law_settings[refused]['d_hat_max_v']:g} V, so the command would jump: "
            f"`motorctl stop {name}` first, or give it more"
        )


def _settings(
    before: Tick, models: OtherModels, made: NDArray[np.void], windows: Sequence[float]
) -> NDArray[np.void]:
    """Return what the axes run with: what they had, but for what comes of the models."""
    settings = before.settings.copy()
    for field in models.own_settings:
        settings[field] = made[field]
    for field in WINDOW:
        settings[field] = made[field] * np.array(windows or 1.0)
    return settings


def _carry_on(before: NDArray[np.void], after: NDArray[np.void], axis: int) -> None:
    """Copy the state of a law; of memories that have another size now, what both have."""
    if before.dtype == after.dtype:
        after[axis] = before[axis]
        return
    for name in before.dtype.names or ():
        own, new = before[name], after[name]
        both = (slice(min(s)) for s in zip(own.shape[1:], new.shape[1:], strict=True))
        place: Any = (axis, *both)
        new[place] = own[place]
