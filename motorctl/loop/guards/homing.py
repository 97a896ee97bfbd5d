"""Guards of homing: it ends in time, off the limit switches, and a beam's ends find their own.

What is searched for, and in which order, is `motorctl.loop.homing` and `motorctl.loop.homing_ends`.
"""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.guards.motion import is_blocked
from motorctl.loop.guards.reactions import trip


@inner_kernel
def check_homing(settings: Any, axis: Any, t: float) -> bool:
    """Return whether homing goes on; trip where it runs onto a limit switch, or takes too long."""
    if is_blocked(axis):
        trip(axis, FaultCause.HOMING_FAILED, axis.position_m, 0.0, t)
        return False
    if axis.phase_ticks > settings.homing_ticks:
        passed_s = axis.phase_ticks * settings.period_s
        trip(axis, FaultCause.HOMING_FAILED, passed_s, settings.homing_ticks * settings.period_s, t)
        return False
    return True


@inner_kernel
def check_apart(settings: Any, axis: Any, dual: Any, latches: bool, t: float) -> None:
    """Trip where one end has gone on for too long since the other found what it looks for.

    And, once both have latched it, where they lie too far apart for a beam that could be squared.
    latches: what is found in this phase is an edge or a mark that counts, not just a switch.
    """
    first, second = dual.first, dual.second
    allowed = settings.max_out_of_square_m
    if first.done and second.done:
        if not latches:
            return
        apart = first.latched_m - second.latched_m - settings.square_offset_m
        if abs(apart) > allowed:
            trip(axis, FaultCause.NOT_SQUARE, apart, allowed, t)
    elif first.done or second.done:
        gone = abs(axis.position_m - dual.apart_from_m)
        allowed += abs(settings.square_offset_m)
        if gone > allowed:
            trip(axis, FaultCause.NOT_SQUARE, gone, allowed, t)
    else:
        dual.apart_from_m = axis.position_m
