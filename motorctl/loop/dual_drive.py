"""Two motors and two encoders on one beam as one axis: both counts in, both commands out.

An axis with a dual drive reads the sum of its ends' counts, each unwrapped here, so that its
position is their mean; state machine, law and guards are those of every axis. What the two differ
in is held by the skew loop (`motorctl.loop.skew`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from motorctl.hal import CODE_MASK, FAULT_BITS, Status
from motorctl.kernels import inner_kernel
from motorctl.loop.guards.device import (
    COMMUNICATION_LOST,
    ENCODER_LOST,
    ENDS,
    FIRST_END,
    FORGET_PLACE,
    HOME_SWITCH,
    INDEX_LATCHED,
    SECOND_END,
)
from motorctl.loop.guards.encoder import count_is_ambiguous, jump
from motorctl.loop.guards.supervision import stalled_periods
from motorctl.loop.homing_ends import find_marks, joined_marks
from motorctl.loop.missed_samples import counter_step
from motorctl.loop.states import is_enabled

STALE = int(Status.STALE)
MARKS = HOME_SWITCH | INDEX_LATCHED
NOT_READ = ENCODER_LOST | COMMUNICATION_LOST | STALE
TROUBLES = int(FAULT_BITS) | STALE


@inner_kernel
def _read_end(
    axis_settings: Any,
    settings: Any,
    axis: Any,
    end: Any,
    own: int,
    raw: int,
    elapsed: int,
    age: int,
    t: float,
) -> None:
    """Unwrap one end's counter into its position; a step too large trips the axis.

    own is the bit that tells which end it is, elapsed counts the periods that the step may have
    taken, age those since it was sampled, which the next step has besides. After a step too large
    an absolute encoder's count is taken anew from the next sample.
    """
    ticks, paused = elapsed + end.blind_ticks, end.paused_ticks + elapsed - 1
    if not end.have_counts:
        end.have_counts, end.counts, end.velocity_m_s = 1, raw, 0.0
        span = settings.counter_span
        travel_m = axis_settings.travel_high_m - axis_settings.travel_low_m
        if settings.absolute and span * abs(settings.metres_per_count) >= travel_m:
            middle = 0.5 * (axis_settings.travel_low_m + axis_settings.travel_high_m)
            middle -= settings.offset_m
            end.counts += span * round((middle / settings.metres_per_count - raw) / span)
    else:
        step = counter_step(settings, end.raw_counts, raw)
        if count_is_ambiguous(settings, end, step, ticks):
            before = axis.fault
            jump(settings, axis, step, ticks, paused, t)
            if axis.fault != before:
                axis.fault_status |= own
            end.have_counts = 1 - settings.absolute
        end.counts += step
        end.velocity_m_s = settings.metres_per_count * step / (settings.period_s * ticks)
    end.raw_counts, end.blind_ticks, end.paused_ticks = raw, age, age
    end.step_ticks = ticks
    end.position_m = settings.metres_per_count * end.counts + settings.offset_m


@inner_kernel
def _forget(dual: Any) -> None:
    """Begin both ends as at their first sample."""
    dual.first.have_counts, dual.second.have_counts = 0, 0


@inner_kernel(error_model="numpy")
def join_ends(
    axis_settings: Any,
    settings: Any,
    axis: Any,
    dual: Any,
    raw: int,
    second_raw: int,
    raw_index: int,
    second_raw_index: int,
    status: int,
    second_status: int,
    elapsed: int,
    behind: int,
    t: float,
) -> None:
    """Make one count and one status word of those of both ends.

    What one end's device reports concerns the axis: its fault, a limit switch, a sample that did
    not come. Home switches and index marks are found by both ends (`joined_marks`).
    """
    joined = np.int64(status | second_status)
    if status & CODE_MASK:  # two error codes would make a third one
        joined = (joined & ~CODE_MASK) | (status & CODE_MASK)
    first, second = dual.first, dual.second
    if joined & FORGET_PLACE:
        _forget(dual)
    dual.second_status = second_status & ~FORGET_PLACE
    if status & TROUBLES:
        joined |= FIRST_END
    if second_status & TROUBLES:
        joined |= SECOND_END
    first.pressed = status & HOME_SWITCH
    second.pressed = second_status & HOME_SWITCH
    if joined & NOT_READ:
        first.blind_ticks += elapsed
        second.blind_ticks += elapsed
        first.paused_ticks += elapsed - 1
        second.paused_ticks += elapsed - 1
        if not joined & (ENCODER_LOST | COMMUNICATION_LOST):
            find_marks(settings, axis, dual, raw_index, second_raw_index, status, second_status)
        elif axis_settings.absolute:
            _forget(dual)
        dual.status = (joined & ~MARKS) | (dual.status & HOME_SWITCH)
        return
    begins = not (first.have_counts and second.have_counts)
    # In a pause of the loop the ends may go far, and a sample of one exchange a period is as old.
    passed = stalled_periods(axis_settings, elapsed, behind) + 1
    age = elapsed - 1 if axis_settings.exchange else 0
    one, two = settings.first, settings.second
    _read_end(axis_settings, one, axis, first, FIRST_END, raw, passed, age, t)
    _read_end(axis_settings, two, axis, second, SECOND_END, second_raw, passed, age, t)
    if begins:
        # Without a zero the beam counts as square where it is found.
        apart_m = first.position_m - second.position_m
        dual.shift_m = 0.0 if axis_settings.absolute else -apart_m
        dual.squared = axis_settings.absolute
    dual.skew_m = first.position_m - second.position_m + dual.shift_m
    dual.raw_counts = settings.direction * first.counts
    dual.raw_counts += settings.second_direction * second.counts
    marks = joined_marks(
        axis_settings, settings, axis, dual, raw_index, second_raw_index, status, second_status, t
    )
    dual.status = (joined & ~MARKS) | marks


@inner_kernel
def drive_ends(
    axis_settings: Any,
    settings: Any,
    axis: Any,
    dual: Any,
    law_settings: Any,
    u: float,
    volts: Any,
    channel: int,
    second_channel: int,
    sample: Any,
) -> None:
    """Give each motor its command, within the limit; nothing to either where the axis is off."""
    limit = axis_settings.max_voltage_v
    if not is_enabled(axis):
        dual.command_v = 0.0
        volts[channel], volts[second_channel] = 0.0, 0.0
    else:
        first, second = u + dual.command_v, u - dual.command_v
        volts[channel] = min(max(first, -limit), limit)
        volts[second_channel] = settings.motor_direction * min(max(second, -limit), limit)
        # The guards of the command look at the motor that has more of it.
        most = abs(u) + abs(dual.command_v)
        if abs(u) >= law_settings.max_voltage_v:
            most = limit
        axis.command_v = math.copysign(most, u)
    sample.device_status = axis.status & ~ENDS
    sample.skew_m = dual.skew_m
    sample.skew_reference_m = dual.reference_m
    sample.skew_command_v = dual.command_v
    sample.second_device_status = dual.second_status


@inner_kernel
def report_skew(axis: Any, dual: Any, status: Any) -> None:
    """Copy what `status` shows of a dual drive besides."""
    status.device_status = axis.status & ~ENDS
    status.skew_m = dual.skew_m
    status.skew_reference_m = dual.reference_m
    status.skew_command_v = dual.command_v
    status.second_device_status = dual.second_status
