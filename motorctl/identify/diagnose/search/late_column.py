"""Effects that are a command whose column was smoothed, or late, when it was recorded.

A drive that tells its current tells it filtered. Its column then falls behind the acceleration the
more, the faster both change, as the force does on a part that hangs on a spring; and it turns over
after the motion did, as bristles and gaps do. With the recorded command on the left this is a
hypothesis of equal standing with one number, where a resonance, bristles or a gap have more: so it
is asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import CommandPath, RecordedLate
from motorctl.identify.diagnose.search.acceptance import AS_WELL
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import Effect

Array = NDArray[np.float64]

AROUND = 4.0
"""Factor by which the times that are tried lie below and above that of the resonance, 1/omega.
Larger takes time, smaller misses filters that act farther away from it. Chosen by hand."""
TRIED = 9
"""Times that are tried, of each kind. More takes time, fewer steps over the best one. Arithmetic:
neighbours are a factor of 1.4 to 1.6 apart."""
AT_TURNS_S = (1e-3, 0.04)
"""Shortest and longest time that is tried where an effect acts at turns [s]. Larger takes slow
feedback for a logger, smaller misses slow ones. Chosen by hand: a current of an arm was recorded 15
to 30 ms late."""
STEP = 1.5
"""Factor around the best of them between which it is sought once more. Larger is rough, smaller may
leave it out. Arithmetic: they are a factor of 1.6 apart."""
PLAINLY_LATE = 0.3
"""Part of the squared error that a late column leaves, below which it is told as one. Larger tells
of columns that a drive filters, smaller of few. Chosen by hand: a column that was shifted on
purpose leaves 0.04, filtered ones 0.36 and more."""


@dataclass(frozen=True)
class _OfLateColumn(Hypothesis):
    """A model whose command was smoothed or late when it was recorded."""

    smoothed_s: float = 0.0
    late_s: float = 0.0

    @property
    def undone(self) -> CommandPath:
        """Return the path that is taken back, and what the record did to its end."""
        path = self.path
        return RecordedLate(path.delay_s, path.lag_s, self.smoothed_s, self.late_s)


def as_late_column(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return an effect that a late column explains as well with one number, and what to say."""
    if final.regressors.side != "command":
        return None
    for effect in final.added:
        times_s = _times_s(effect)
        if times_s is None:
            continue
        rest = final.without(effect.name).refreshed()
        left, smoothed_s, late_s = _best(rest, times_s)
        if "resonance" not in effect.groups:  # a turn is sharp
            near = max(smoothed_s, late_s) * np.geomspace(1.0 / STEP, STEP, TRIED)
            left, smoothed_s, late_s = min((left, smoothed_s, late_s), _best(rest, near))
        if left > AS_WELL * final.held_out:
            continue
        if late_s and left < PLAINLY_LATE * rest.held_out:
            return effect, (
                f"{effect.name} is refuted: the motion answers to the command "
                f"{1e3 * late_s:.2g} ms before it was recorded: this leaves "
                f"{100.0 * left / rest.held_out:.0f} % of the squared error, {effect.name} "
                f"{100.0 * final.held_out / rest.held_out:.0f} %, with more numbers. Where the "
                f"column is late, give the command late_s: {late_s:.2g} in the description"
            )
        kind = "smoothed over" if smoothed_s else "late by"
        return effect, (
            f"{effect.name} is refuted: a command whose column is {kind} "
            f"{1e3 * max(smoothed_s, late_s):.2g} ms leaves "
            f"{100.0 * left / rest.held_out:.0f} % of the squared error, this "
            f"{100.0 * final.held_out / rest.held_out:.0f} %, with more numbers. Record the "
            "command as it was sent, before any filter"
        )
    return None


def _times_s(effect: Effect) -> Array | None:
    """Return the times that are tried instead of an effect, None where none could be it."""
    if "resonance" in effect.groups and effect.lines:
        time_s = 1.0 / (2.0 * math.pi * min(effect.lines))
        return np.geomspace(time_s / AROUND, AROUND * time_s, TRIED)
    if effect.kind == "state" and type(effect).remembers():
        return np.geomspace(*AT_TURNS_S, TRIED)
    return None


def _best(rest: Hypothesis, times_s: Array) -> tuple[float, float, float]:
    """Return the least held-out squared error, and how long a column is smoothed or late."""
    found = []
    for tried in times_s:
        for smoothed_s, late_s in ((float(tried), 0.0), (0.0, float(tried))):
            model = _OfLateColumn(
                rest.regressors, rest.added, rest.acceleration, smoothed_s, late_s
            )
            found.append((model.held_out, smoothed_s, late_s))
    return min(found)
