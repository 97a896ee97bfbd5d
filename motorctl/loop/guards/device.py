"""Guards of the device: what its driver reports, and that it reports at all."""

from __future__ import annotations

from typing import Any

from motorctl.hal import FAULT_BITS, Status
from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import StallLimit
from motorctl.loop.guards.reactions import trip, trip_on_stall

ENCODER_LOST = int(Status.ENCODER_LOST)
AMPLIFIER_FAULT = int(Status.AMPLIFIER_FAULT)
COMMUNICATION_LOST = int(Status.COMMUNICATION_LOST)
HARDWARE_ESTOP = int(Status.ESTOP)
HOME_SWITCH = int(Status.HOME_SWITCH)
INDEX_LATCHED = int(Status.INDEX_LATCHED)
DEVICE_FAULTS = int(FAULT_BITS)
BY_HOLD_TICKS = int(StallLimit.HOLD_TICKS)
FORGET_PLACE = 1 << 31
"""Beside a driver's bits of `Status`: it is being opened anew, and what it counted is void."""
FIRST_END, SECOND_END = 1 << 29, 1 << 30
"""As well, in a dual drive: which end reports a fault, or brings no sample."""
ENDS = FIRST_END | SECOND_END


@inner_kernel
def forget_place(settings: Any, axis: Any) -> None:
    """Begin as at the first sample: a device that was lost may count from anywhere.

    What was learned of the axis stays.
    """
    axis.have_counts, axis.shift_m = 0, 0.0
    axis.homed = settings.absolute


@inner_kernel
def check_device(settings: Any, axis: Any, t: float) -> None:
    """Trip on what the driver reports; no pause of the loop presses an emergency stop."""
    status = axis.status
    if status & ENCODER_LOST:
        _trip_on_report(settings, axis, FaultCause.ENCODER_LOST, t)
    elif status & COMMUNICATION_LOST:
        _trip_on_report(settings, axis, FaultCause.COMMUNICATION, t)
    elif status & HARDWARE_ESTOP:
        trip(axis, FaultCause.ESTOP, float(status), 0.0, t)
    elif status & AMPLIFIER_FAULT:
        _trip_on_report(settings, axis, FaultCause.AMPLIFIER, t)


@inner_kernel
def _trip_on_report(settings: Any, axis: Any, cause: int, t: float) -> None:
    """Trip at once: for what the device reports, or for the pause of the loop that it comes of."""
    if axis.stalled_ticks:
        _trip_on_pause(settings, axis, t)
    else:
        trip(axis, cause, float(axis.status), 0.0, t)


@inner_kernel
def _trip_on_pause(settings: Any, axis: Any, t: float) -> None:
    stalled, patience = float(axis.stalled_ticks), float(settings.patience_ticks)
    trip_on_stall(axis, stalled, patience, settings.patience_by, t)


@inner_kernel
def check_freshness(settings: Any, axis: Any, elapsed: int, t: float) -> None:
    """Trip where no new sample has come for longer than the configuration allows.

    Where the loop itself was stopped for so long, in one pause or in several, or for longer than
    the device may have stood, that is the cause, and not the device.
    """
    if not is_overdue(settings, axis):
        return
    stopped, hold_ticks = elapsed - 1, settings.hold_ticks
    if stopped > 0 and elapsed > hold_ticks:
        trip_on_stall(axis, float(stopped), float(hold_ticks), BY_HOLD_TICKS, t)
    elif axis.stalled_ticks:
        _trip_on_pause(settings, axis, t)
    elif axis.paused_ticks > hold_ticks:
        trip_on_stall(axis, float(axis.paused_ticks), float(hold_ticks), BY_HOLD_TICKS, t)
    else:
        without = float(ticks_without(axis))
        trip(axis, FaultCause.NO_NEW_SAMPLE, without, float(hold_ticks), t)


@inner_kernel
def is_overdue(settings: Any, axis: Any) -> bool:
    """Return whether the last sample is older than an axis may be driven by."""
    return ticks_without(axis) > settings.hold_ticks  # type: ignore[no-any-return]


@inner_kernel
def ticks_without(axis: Any) -> int:
    """Return for how many ticks no sample has come; those that were doubted came all the same."""
    return axis.held_ticks - axis.doubted_ticks  # type: ignore[no-any-return]
