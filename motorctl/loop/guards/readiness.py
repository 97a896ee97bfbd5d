"""What keeps a disabled axis from being enabled: a device that is not ready, or motion."""

from __future__ import annotations

from typing import Any

from motorctl.hal import Status
from motorctl.kernels import inner_kernel
from motorctl.loop.guards.device import DEVICE_FAULTS, is_overdue
from motorctl.loop.guards.motion import still_moves
from motorctl.loop.states import Event, State, is_off, take
from motorctl.loop.vocabulary import Reply

UNPOWERED = int(Status.UNPOWERED)


@inner_kernel
def is_unwell(settings: Any, axis: Any) -> bool:
    """Return whether the device reports a fault, or nothing at all."""
    return axis.status & DEVICE_FAULTS != 0 or is_overdue(settings, axis)


@inner_kernel
def check_readiness(settings: Any, axis: Any) -> Reply:
    """Let the state of an axis that is off say whether it may be enabled; return OK, or why not."""
    if not is_off(axis):
        return Reply.OK
    answer = Reply.OK
    if is_unwell(settings, axis):
        answer = Reply.STILL_FAULTY
    elif still_moves(settings, axis):
        answer = Reply.STILL_MOVING
    take(axis, Event.READY if answer == Reply.OK else Event.NOT_READY)
    return answer


@inner_kernel
def has_power(axis: Any) -> bool:
    """Return whether volts act: false only where the driver says so."""
    return axis.status & UNPOWERED == 0  # type: ignore[no-any-return]


@inner_kernel
def waits_for_power(axis: Any) -> bool:
    """Return whether an axis was started whose amplifier is still on its way to be on."""
    return axis.state == State.SWITCHED_ON and not has_power(axis)
