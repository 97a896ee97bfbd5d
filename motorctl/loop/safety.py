"""The safety rules of an axis, all of them here: what trips it, checked before a command leaves."""

from __future__ import annotations

import math
from typing import Any

from motorctl.hal import FAULT_BITS, Status
from motorctl.kernels import inner_kernel
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.axis_records import (
    JUMP_SPEED_RATIO,
    OVERSPEED_RATIO,
    OVERSPEED_TICKS,
    STANDSTILL_RATIO,
)

HOMING = int(AxisState.HOMING)
FAULT = int(AxisState.FAULT)

ENCODER_LOST = int(Status.ENCODER_LOST)
AMPLIFIER_FAULT = int(Status.AMPLIFIER_FAULT)
COMMUNICATION_LOST = int(Status.COMMUNICATION_LOST)
HARDWARE_ESTOP = int(Status.ESTOP)
LIMIT_NEGATIVE = int(Status.LIMIT_NEGATIVE)
LIMIT_POSITIVE = int(Status.LIMIT_POSITIVE)
DEVICE_FAULTS = int(FAULT_BITS)
FORGET_PLACE = 1 << 31
"""Beside a driver's bits of `Status`: it is being opened anew, and what it counted is void."""

CAUSE_FOLLOWING_ERROR = int(FaultCause.FOLLOWING_ERROR)
CAUSE_SOFT_LIMIT = int(FaultCause.SOFT_LIMIT)
CAUSE_OVERSPEED = int(FaultCause.OVERSPEED)
CAUSE_NOT_A_NUMBER = int(FaultCause.NOT_A_NUMBER)
CAUSE_ENCODER_LOST = int(FaultCause.ENCODER_LOST)
CAUSE_ENCODER_JUMP = int(FaultCause.ENCODER_JUMP)
CAUSE_AMPLIFIER = int(FaultCause.AMPLIFIER)
CAUSE_COMMUNICATION = int(FaultCause.COMMUNICATION)
CAUSE_NO_NEW_SAMPLE = int(FaultCause.NO_NEW_SAMPLE)
CAUSE_OVERRUN = int(FaultCause.OVERRUN)
CAUSE_ESTOP = int(FaultCause.ESTOP)
CAUSE_LIMIT_SWITCH = int(FaultCause.LIMIT_SWITCH)


@inner_kernel
def trip(axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    """Put the axis into FAULT, keeping the first cause with its value and limit.

    An axis that is being stopped for a cause has that one already.
    """
    if axis.state != FAULT:
        if axis.fault == 0:
            axis.fault = cause
            axis.fault_value = value
            axis.fault_limit = limit
            axis.fault_time_s = t
            axis.fault_status = axis.status | axis.held_status
        axis.state = FAULT
        axis.slot = -1


@inner_kernel
def forget_place(settings: Any, axis: Any) -> None:
    """Begin as at the first sample: a device that was lost may count from anywhere.

    What was learned of the axis stays.
    """
    axis.have_counts, axis.shift_m = 0, 0.0
    axis.homed = settings.absolute


@inner_kernel
def check_device(axis: Any, t: float) -> None:
    """Trip on what the driver reports."""
    status = axis.status
    if status & ENCODER_LOST:
        trip(axis, CAUSE_ENCODER_LOST, float(status), 0.0, t)
    elif status & COMMUNICATION_LOST:
        trip(axis, CAUSE_COMMUNICATION, float(status), 0.0, t)
    elif status & HARDWARE_ESTOP:
        trip(axis, CAUSE_ESTOP, float(status), 0.0, t)
    elif status & AMPLIFIER_FAULT:
        trip(axis, CAUSE_AMPLIFIER, float(status), 0.0, t)


@inner_kernel
def check_freshness(settings: Any, axis: Any, elapsed: int, t: float) -> None:
    """Trip where no new sample has come for longer than the configuration allows.

    Where the loop itself was stopped for so long, that is the cause, and not the device.
    """
    stopped = elapsed - 1
    if is_overdue(settings, axis) and stopped > 0 and elapsed > settings.hold_ticks:
        trip(axis, CAUSE_OVERRUN, float(stopped), float(settings.hold_ticks), t)
    elif is_overdue(settings, axis):
        without = float(ticks_without(axis))
        trip(axis, CAUSE_NO_NEW_SAMPLE, without, float(settings.hold_ticks), t)


@inner_kernel
def is_overdue(settings: Any, axis: Any) -> bool:
    """Return whether the last sample is older than an axis may be driven by."""
    return ticks_without(axis) > settings.hold_ticks  # type: ignore[no-any-return]


@inner_kernel
def ticks_without(axis: Any) -> int:
    """Return for how many ticks no sample has come; those that were doubted came all the same."""
    return axis.held_ticks - axis.doubted_ticks  # type: ignore[no-any-return]


@inner_kernel
def count_is_ambiguous(settings: Any, axis: Any, step: int, elapsed: int) -> bool:
    """Return whether a step of the counter is too large to be motion, or may hide whole turns.

    elapsed counts the periods since the last count that could be trusted.
    """
    seconds = settings.period_s * elapsed
    unit = abs(settings.metres_per_count)
    span = settings.counter_span
    if span:
        if abs(step) >= span // 4:
            return True
        fastest = OVERSPEED_RATIO * settings.max_velocity_m_s
        if not axis.blind_ticks:
            gained = 2.0 * settings.max_acceleration_m_s2 * seconds
            fastest = min(fastest, abs(axis.velocity_m_s) + gained)
        if elapsed > 1 and fastest * seconds >= 0.75 * span * unit:
            return True
    reach = JUMP_SPEED_RATIO * settings.max_velocity_m_s * seconds
    return abs(step) * unit > reach + 8.0 * unit  # type: ignore[no-any-return]


@inner_kernel
def still_moves(settings: Any, axis: Any) -> bool:
    """Return whether the axis moves too fast to be enabled: holding it would be a jolt."""
    noise = 8.0 * abs(settings.metres_per_count) / settings.period_s
    return abs(axis.velocity_m_s) > STANDSTILL_RATIO * settings.max_velocity_m_s + noise  # type: ignore[no-any-return]


@inner_kernel
def set_soft_limits(settings: Any, axis: Any) -> None:
    """Put the soft limits in force; outside its travel an axis may move back, not further out.

    References never leave the travel. The axis itself may, by what its error may be at rest, or
    it could not stand at an end.
    """
    axis.soft_low_m = (
        min(settings.travel_low_m, axis.position_m) - settings.following_error_minimum_m
    )
    axis.soft_high_m = (
        max(settings.travel_high_m, axis.position_m) + settings.following_error_minimum_m
    )


@inner_kernel
def _tighten_soft_limits(settings: Any, axis: Any) -> None:
    """Let the limits follow an axis that comes back from outside its travel."""
    x, slack = axis.position_m, settings.following_error_minimum_m
    axis.soft_low_m = max(axis.soft_low_m, min(settings.travel_low_m, x) - slack)
    axis.soft_high_m = min(axis.soft_high_m, max(settings.travel_high_m, x) + slack)


@inner_kernel
def check_motion(settings: Any, axis: Any, elapsed: int, t: float) -> None:
    """Trip on speed, soft limits, limit switches and following error."""
    x, v = axis.position_m, axis.velocity_m_s
    fastest = OVERSPEED_RATIO * settings.max_velocity_m_s
    # One count more or less is no speed.
    noise = 2.0 * abs(settings.metres_per_count) / settings.period_s
    if not axis.held_ticks:  # a speed that is only held, or predicted, says nothing new
        axis.fast_count = axis.fast_count + 1 if abs(v) > fastest + noise else 0
    if axis.fast_count >= OVERSPEED_TICKS:
        trip(axis, CAUSE_OVERSPEED, v, fastest, t)
    if axis.homed:
        _tighten_soft_limits(settings, axis)
        if x < axis.soft_low_m:
            trip(axis, CAUSE_SOFT_LIMIT, x, axis.soft_low_m, t)
        elif x > axis.soft_high_m:
            trip(axis, CAUSE_SOFT_LIMIT, x, axis.soft_high_m, t)
    if axis.status & LIMIT_NEGATIVE and axis.reference_velocity_m_s < 0.0:
        trip(axis, CAUSE_LIMIT_SWITCH, x, settings.travel_low_m, t)
    elif axis.status & LIMIT_POSITIVE and axis.reference_velocity_m_s > 0.0:
        trip(axis, CAUSE_LIMIT_SWITCH, x, settings.travel_high_m, t)
    error = x - axis.reference_m
    allowed = settings.following_error_minimum_m + settings.following_error_per_velocity_s * abs(
        axis.reference_velocity_m_s
    )
    axis.error_count = axis.error_count + elapsed if abs(error) > allowed else 0
    if axis.error_count > settings.error_ticks:
        trip(axis, CAUSE_FOLLOWING_ERROR, error, allowed, t)


@inner_kernel
def checked_voltage(settings: Any, axis: Any, u: float, v: float, t: float) -> float:
    """Return the command that may leave: within the voltage limit, zero where the axis tripped.

    v is the virtual command that u was found for.
    """
    if not (math.isfinite(u) and math.isfinite(v)):
        trip(axis, CAUSE_NOT_A_NUMBER, 0.0, settings.max_voltage_v, t)
    if axis.state == FAULT:
        return 0.0
    return min(max(u, -settings.max_voltage_v), settings.max_voltage_v)  # type: ignore[no-any-return]
