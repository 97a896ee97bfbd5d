"""What a guard does when it trips: let the axis go at once, or ramp it down before."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import STALL_LIMIT_SHIFT
from motorctl.loop.reference import UNDECIDED
from motorctl.loop.states import Event, is_powered, take


@inner_kernel
def react(settings: Any, axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    """Do what the configuration says for this cause to an axis that is enabled."""
    if settings.quick_stops >> cause & 1:
        quick_stop(axis, cause, value, limit, t)
    else:
        trip(axis, cause, value, limit, t)


@inner_kernel
def quick_stop(axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    """Let the axis ramp down and end in FAULT; one that is being stopped for a cause has that one.

    An ordinary stop that is under way becomes one for this cause.
    """
    if take(axis, Event.QUICK_STOP):
        axis.brake = UNDECIDED
        axis.slot = -1
        _note(axis, cause, value, limit, t)


@inner_kernel
def _note(axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    axis.fault = cause
    axis.fault_value, axis.fault_limit, axis.fault_time_s = value, limit, t
    axis.fault_status = axis.status | axis.held_status


@inner_kernel
def react_to_others(
    settings: Any, axis: Any, cause: int, value: float, limit: float, t: float
) -> None:
    """Stop an axis that is in order itself; one that is off, or is being stopped, is left so."""
    if is_powered(axis):
        react(settings, axis, cause, value, limit, t)


@inner_kernel
def trip(axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    """Put the axis into FAULT, keeping the first cause with its value and limit.

    An axis that is being stopped for a cause has that one already.
    """
    if take(axis, Event.TRIP):
        _let_go(axis, cause, value, limit, t)


@inner_kernel
def trip_on_stall(axis: Any, stalled: float, limit: float, by: int, t: float) -> None:
    """Put the axis into FAULT because the loop was stalled, keeping which limit that was beyond."""
    before = axis.fault
    trip(axis, FaultCause.HOST_FROZEN, stalled, limit, t)
    _note_limit(axis, before, by)


@inner_kernel
def ramp_on_stall(axis: Any, stalled: float, limit: float, by: int, t: float) -> None:
    """Let the axis ramp down because the loop was stalled, keeping which limit that was beyond."""
    before = axis.fault
    quick_stop(axis, FaultCause.HOST_FROZEN, stalled, limit, t)
    _note_limit(axis, before, by)


@inner_kernel
def _note_limit(axis: Any, before: int, by: int) -> None:
    if before == 0 and axis.fault == FaultCause.HOST_FROZEN:
        axis.fault_status |= by << STALL_LIMIT_SHIFT


@inner_kernel
def emergency_stop(axis: Any, t: float) -> None:
    """Put the axis into FAULT because somebody said so, whatever it does."""
    before = axis.state
    if take(axis, Event.ESTOP) and axis.state != before:
        _let_go(axis, FaultCause.ESTOP, 0.0, 0.0, t)


@inner_kernel
def _let_go(axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    if axis.fault == 0:
        _note(axis, cause, value, limit, t)
    axis.slot = -1


@inner_kernel
def stop(axis: Any) -> bool:
    """Let an enabled axis ramp down and switch off, as it was told to; False: its state refuses."""
    before = axis.state
    if not take(axis, Event.STOP):
        return False
    if axis.state != before:
        axis.brake = UNDECIDED
        axis.slot, axis.program, axis.fault = -1, 0, 0
    return True
