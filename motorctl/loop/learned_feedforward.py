"""What was learned for a program that repeats: added by the place in it, while it is followed.

It begins and ends with the program's cycles, and with whatever ends these. It comes and goes
without a step: the fast adaptation takes it up, as far as its bound allows, and the rest fades; no
rest outlasts a fault. An axis that does not ask for it has no code for it in the tick.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.control.command_filter import shift_filter
from motorctl.kernels import inner_kernel
from motorctl.loop.states import State, is_enabled

LEARNED_POINTS = 65536
"""Most points in a cycle: the slot in shared memory is so long, 13 s at 5 kHz with a point a tick.
Longer cycles have points further apart."""
FADE_TICKS = 250
"""Ticks in which the rest goes, at its largest. In 30 the largest that a configuration allows
changes by 1 % of the axis' voltage from tick to tick, so fewer are a step; more leave it for longer
where it does not belong. By hand."""

LEARNED = np.dtype(
    [
        ("points", "i8"),  # in a cycle; 0: nothing was learned for what is in this program slot
        ("models_row", "i8"),  # that of the models for which it was learned
        ("lead_s", "f8"),  # from the slot's begin to that of the first cycle
        ("cycle_s", "f8"),
        ("lasts_s", "f8"),  # all cycles
        ("volts", "f8", (LEARNED_POINTS,)),  # one cycle, evenly spaced
    ],
    align=True,
)
"""What is added while the axis follows what is in a program slot."""


@dataclass(frozen=True)
class LearnedFeedforward:
    """One cycle of a learned voltage, and when in a motion the cycles come."""

    volts: NDArray[np.float64]
    """(points,) evenly spaced over a cycle [V]."""
    lead_s: float
    """From the begin of the motion to that of the first cycle [s]."""
    cycle_s: float
    cycles: int
    models_row: int | None = None
    """The loop's, of the models with which it was learned: with others nothing is added; None:
    those that run."""


def write_slot(slot: np.void, learned: LearnedFeedforward | None, models_row: int) -> None:
    """Write what is added into a record of LEARNED; None: nothing.

    models_row is that of the models that run.
    """
    slot["points"] = 0
    if learned is None:
        return
    slot["models_row"] = models_row if learned.models_row is None else learned.models_row
    count = len(learned.volts)
    slot["volts"][:count] = learned.volts
    slot["lead_s"], slot["cycle_s"] = learned.lead_s, learned.cycle_s
    slot["lasts_s"] = learned.cycles * learned.cycle_s
    slot["points"] = count


@inner_kernel(error_model="numpy")
def lead_by_learned(
    settings: Any,
    axis: Any,
    law_settings: Any,
    law: Any,
    learned: Any,
    models_row: int,
    elapsed: int,
    tick: int,
) -> None:
    """Let the law's command have in this tick what was learned, within its own limit.

    models_row is that of the models that run.
    """
    value, inside = 0.0, False
    if axis.state == State.FOLLOWING and axis.slot >= 0:
        slot = learned[axis.slot]
        passed_s = (tick - axis.start_tick) * settings.tick_s - slot.lead_s
        if 0 < slot.points <= slot.volts.size and slot.models_row == models_row:
            inside = 0.0 <= passed_s < slot.lasts_s
        if inside:
            value = _at(slot, passed_s)
            value = min(max(value, -settings.max_learned_v), settings.max_learned_v)
    if inside != (axis.learned_on != 0):
        # The fast adaptation takes over what comes or goes, so that the command does not.
        comes = value if inside else axis.learned_rest_v - axis.learned_v
        axis.learned_rest_v -= comes - _taken_up(law_settings, law, comes)
        axis.learned_on = 1 if inside else 0
    if not is_enabled(axis) or axis.fault:
        axis.learned_rest_v = 0.0
    elif axis.learned_rest_v != 0.0:
        step = elapsed * settings.max_learned_v / FADE_TICKS
        left = max(abs(axis.learned_rest_v) - step, 0.0)
        axis.learned_rest_v = math.copysign(left, axis.learned_rest_v)
    added = value + axis.learned_rest_v
    axis.learned_v = min(max(added, -settings.max_learned_v), settings.max_learned_v)
    law.learned_v = axis.learned_v


@inner_kernel
def _taken_up(law_settings: Any, law: Any, volts: float) -> float:
    """Let the fast adaptation take up volts that come beside the law; return how many it could."""
    if law_settings.gamma_d == 0.0:
        return 0.0  # it would keep them
    before, most = law.d0, law_settings.d_hat_max_v
    law.d0 = min(max(before + volts, -most), most)
    shift_filter(law_settings, law, before - law.d0)
    return law.d0 - before  # type: ignore[no-any-return]


@inner_kernel(error_model="numpy")
def _at(slot: Any, passed_s: float) -> float:
    """Return what was learned for a time since the first cycle's begin [V]."""
    points = slot.points
    place = passed_s / slot.cycle_s
    place = (place - math.floor(place)) * points
    before = min(int(place), points - 1)
    after = before + 1 if before + 1 < points else 0
    return slot.volts[before] + (place - before) * (slot.volts[after] - slot.volts[before])  # type: ignore[no-any-return]
