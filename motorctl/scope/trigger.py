"""What a capture begins with: a row that does what was asked for, looked for in every row."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from motorctl.api.samples import Samples
from motorctl.errors import UsageError
from motorctl.log.sample import AxisState

LONGEST_S = 30.0
"""Before and after a trigger, each: both have to be within what is kept."""


class Trigger(BaseModel):
    """What is waited for, and what is kept around it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    kind: Literal["fault", "state", "program", "level"]
    """An axis trips; its state changes; it begins to run; a column crosses a level."""
    axis: str | None = None
    """Which axis; None: any."""
    column: str | None = None
    level: float = 0.0
    hysteresis: float = Field(0.0, ge=0.0)
    """How far back it has to go before it can cross again."""
    edge: Literal["rising", "falling"] = "rising"
    mode: Literal["auto", "normal", "single"] = "single"
    """Once; again and again; again and again, and in between the page follows the machine."""
    pre_s: float = Field(1.0, ge=0.0, le=LONGEST_S)
    post_s: float = Field(1.0, ge=0.0, le=LONGEST_S)

    @model_validator(mode="after")
    def _has_a_column(self) -> Self:
        if (self.column is None) == (self.kind == "level"):
            raise ValueError("a column is what a level needs, and nothing else")
        return self


class Watch:
    """Looks for a trigger in rows as they come. Raises UsageError where it fits no column.

    Parameters
    ----------
    trigger
        What is looked for.
    like
        The rows right before the first that are looked at; none of them triggers.
    begins
        `like` are the first that are looked at themselves: there are none before them.
    """

    def __init__(self, trigger: Trigger, like: Samples, *, begins: bool = False) -> None:
        self.trigger = trigger
        axes = like.axes if trigger.axis is None else (trigger.axis,)
        if unknown := [axis for axis in axes if axis not in like.axes]:
            raise UsageError(f"axis: '{unknown[0]}'; there are: {', '.join(like.axes)}")
        if trigger.column is not None and trigger.column not in like:
            raise UsageError(f"column: '{trigger.column}' is none of the machine's")
        self._axes = axes
        self._before: dict[str, float] = {}
        self._ready = False
        if not begins:
            self.find(like)

    def find(self, samples: Samples) -> NDArray[np.intp]:
        """Return every row that triggers, of rows that follow those before; they may be none."""
        if not samples.rows:
            return np.empty(0, np.intp)
        if self.trigger.column is not None:
            return self._crossings(samples[self.trigger.column].astype(float))
        hits = [self._changes(f"{axis}.state", samples) for axis in self._axes]
        return np.flatnonzero(np.any(hits, axis=0))

    def _changes(self, name: str, samples: Samples) -> NDArray[np.bool_]:
        states = samples[name]
        before = np.concatenate(([self._before.get(name, states[0])], states[:-1]))
        self._before[name] = float(states[-1])
        hits: NDArray[np.bool_] = states != before
        if self.trigger.kind == "fault":
            hits &= states == AxisState.FAULT
        elif self.trigger.kind == "program":
            hits &= states == AxisState.RUNNING
        return hits

    def _crossings(self, values: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the rows beyond the level, each the first after one further back than hysteresis.

        Rows between the two say nothing, and leave what was said before.
        """
        level = self.trigger.level
        if self.trigger.edge == "falling":
            values, level = -values, -level
        beyond, back = values >= level, values < level - self.trigger.hysteresis
        told = np.flatnonzero(beyond | back)
        if not len(told):
            return told
        ready = np.concatenate(([self._ready], back[told[:-1]]))
        self._ready = bool(back[told[-1]])
        return told[beyond[told] & ready]
