"""Homing: find the switch, then its edge or the index mark at low speed, and set the zero."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.axis_records import SHARP_TICKS
from motorctl.loop.guards.device import HOME_SWITCH, INDEX_LATCHED
from motorctl.loop.guards.homing import check_homing
from motorctl.loop.reference import ramp
from motorctl.loop.states import Event, take

BACK_OFF = 0  # leave the switch, if it is pressed at the start
SEARCH = 1  # towards the switch
TURN = 2  # stop on the switch
RETREAT = 3  # leave it again, where the edge is to be met from the searching side
LATCH_EDGE = 4
LATCH_INDEX = 5
SETTLE = 6  # stop, then set the zero


@inner_kernel
def begin_homing(settings: Any, axis: Any) -> None:
    """Start the sequence from rest; the axis' next step forgets its place."""
    axis.phase_ticks, axis.blurred = 0, 0
    axis.phase = BACK_OFF if settings.home_on_switch else LATCH_INDEX


@inner_kernel
def is_sharp(axis: Any) -> bool:
    """Return whether an edge that this tick sees lies within the way of a few ticks.

    One that passed in a pause, or while no sample came, has to be met again.
    """
    return axis.held_ticks == 0 and axis.step_ticks <= SHARP_TICKS and axis.blurred == 0  # type: ignore[no-any-return]


@inner_kernel
def home(settings: Any, axis: Any, index_count_m: float, elapsed: int, t: float) -> bool:
    """Move the reference for one tick; set the zero, and return True, once it is found.

    index_count_m is the position of the index mark that the driver latched last.
    """
    pressed = (axis.status & HOME_SWITCH) != 0
    search, latch = settings.search_velocity_m_s, settings.latch_velocity_m_s
    axis.phase_ticks += elapsed
    if not check_homing(settings, axis, t):
        return False
    # A narrow switch may have been run over while stopping: it has to be met again first.
    if axis.phase in (RETREAT, LATCH_EDGE) and pressed:
        axis.seen = 1
    left_switch = axis.seen != 0 and not pressed
    if axis.phase == BACK_OFF:
        if pressed:
            ramp(settings, axis, -search, elapsed)
        elif ramp(settings, axis, 0.0, elapsed):
            axis.phase = SEARCH
    elif axis.phase == SEARCH:
        if pressed:
            axis.phase, axis.seen = TURN, 0
        ramp(settings, axis, 0.0 if pressed else search, elapsed)
    elif axis.phase == TURN:
        if ramp(settings, axis, 0.0, elapsed):
            axis.phase = LATCH_EDGE if search * latch < 0.0 else RETREAT
    elif axis.phase == RETREAT:
        if left_switch:
            if ramp(settings, axis, 0.0, elapsed):
                axis.phase = LATCH_EDGE
        else:
            ramp(settings, axis, -search, elapsed)
    elif axis.phase == LATCH_EDGE:
        # Leaving the switch the edge is where it opens, coming to it where it closes.
        if left_switch if search * latch < 0.0 else pressed:
            axis.latched_m = axis.position_m
            axis.phase = LATCH_INDEX if settings.home_on_index else SETTLE
            if not (settings.home_on_index or is_sharp(axis)):
                axis.phase = BACK_OFF
        ramp(settings, axis, latch, elapsed)
    elif axis.phase == LATCH_INDEX:
        ramp(settings, axis, latch, elapsed)
        if axis.status & INDEX_LATCHED:
            axis.latched_m = index_count_m
            axis.phase = SETTLE
    elif ramp(settings, axis, 0.0, elapsed):
        axis.shift_m += settings.home_position_m - axis.latched_m
        axis.homed = 1
        take(axis, Event.HOMED)
        return True
    return False
