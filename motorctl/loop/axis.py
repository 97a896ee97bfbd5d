"""One tick of one axis: counts in, state machine, law, limits, volts out, sample written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

from motorctl.control import law_step, start_law
from motorctl.control.law import carry_over_gap
from motorctl.control.records import LawFlag
from motorctl.hal import Status
from motorctl.log.sample import AxisState, SampleFlag
from motorctl.loop.homing import home
from motorctl.loop.reference import brake, follow, hold_where_it_is
from motorctl.loop.safety import (
    CAUSE_ENCODER_JUMP,
    COMMUNICATION_LOST,
    ENCODER_LOST,
    check_device,
    check_motion,
    checked_voltage,
    count_is_ambiguous,
    trip,
)

OFF = int(AxisState.OFF)
HOMING = int(AxisState.HOMING)
RUNNING = int(AxisState.RUNNING)
STOPPING = int(AxisState.STOPPING)
FAULT = int(AxisState.FAULT)

LAW_SATURATED = int(LawFlag.SATURATED)
LAW_ADAPTED = int(LawFlag.ADAPTED)
LAW_PROJECTED = int(LawFlag.PROJECTED)
SATURATED = int(SampleFlag.SATURATED)
ADAPTING = int(SampleFlag.ADAPTING)
PROJECTED = int(SampleFlag.PROJECTED)
HOMED = int(SampleFlag.HOMED)
SKIPPED = int(SampleFlag.SKIPPED)
LIMIT_NEGATIVE = int(SampleFlag.LIMIT_NEGATIVE)
LIMIT_POSITIVE = int(SampleFlag.LIMIT_POSITIVE)
HOME_SWITCH = int(SampleFlag.HOME_SWITCH)
INDEX = int(SampleFlag.INDEX)
UNTRUSTED = ENCODER_LOST | COMMUNICATION_LOST
DEVICE_LIMIT_NEGATIVE = int(Status.LIMIT_NEGATIVE)
DEVICE_LIMIT_POSITIVE = int(Status.LIMIT_POSITIVE)
DEVICE_HOME_SWITCH = int(Status.HOME_SWITCH)
DEVICE_INDEX = int(Status.INDEX_LATCHED)


@njit(error_model="numpy")
def read_position(settings: Any, axis: Any, raw: int, elapsed: int, t: float) -> None:
    """Unwrap the counter into a position and a velocity; a step too large is a fault."""
    elapsed += axis.blind_ticks
    if not axis.have_counts:
        axis.have_counts, axis.counts, axis.raw_counts = 1, raw, raw
        axis.velocity_m_s, axis.blind_ticks = 0.0, 0
        span = settings.counter_span
        travel_m = settings.travel_high_m - settings.travel_low_m
        if settings.absolute and span * abs(settings.metres_per_count) >= travel_m:
            # Signed or not, the counter means a place in or near the travel.
            middle = 0.5 * (settings.travel_low_m + settings.travel_high_m) - settings.offset_m
            axis.counts += span * round((middle / settings.metres_per_count - raw) / span)
        axis.position_m = settings.metres_per_count * axis.counts + settings.offset_m + axis.shift_m
        return
    step = raw - axis.raw_counts
    span = settings.counter_span
    if span:
        step = (step + span // 2) % span - span // 2
    if count_is_ambiguous(settings, axis, step, elapsed):
        if axis.state != OFF:
            trip(axis, CAUSE_ENCODER_JUMP, step * settings.metres_per_count, 0.0, t)
        axis.homed = settings.absolute
    axis.blind_ticks = 0
    axis.raw_counts = raw
    axis.counts += step
    axis.velocity_m_s = settings.metres_per_count * step / (settings.period_s * elapsed)
    axis.position_m = settings.metres_per_count * axis.counts + settings.offset_m + axis.shift_m


@njit
def lose_sight(settings: Any, axis: Any, elapsed: int) -> None:
    """Hold the last position where the count cannot be trusted, and know what that costs."""
    axis.blind_ticks += elapsed
    axis.velocity_m_s = 0.0
    if settings.absolute:
        axis.have_counts = 0
    elif axis.status & ENCODER_LOST:
        axis.homed = 0


@njit
def axis_inputs(settings: Any, axis: Any, raw: int, status: int, elapsed: int, t: float) -> None:
    """Take what the driver read, before any command is looked at."""
    axis.status = status
    if axis.state != OFF:
        check_device(axis, t)
    if status & UNTRUSTED:
        lose_sight(settings, axis, elapsed)
    else:
        read_position(settings, axis, raw, elapsed, t)


@njit
def axis_step(
    state_columns: Callable[..., None],
    input_columns: Callable[..., None],
    feedforward: Callable[..., float],
    input_map: Callable[..., float],
    input_slope: Callable[..., float],
    settings: Any,
    axis: Any,
    law_settings: Any,
    law: Any,
    segments: Any,
    segment_counts: Any,
    raw_index: int,
    elapsed: int,
    tick: int,
    t: float,
    sample: Any,
) -> float:
    """Give the voltage for this tick; the amplifier is enabled where the state is not OFF or FAULT.

    elapsed counts the periods since the last tick: 1, or more after an overrun.
    """
    if axis.state == HOMING:
        # The index mark's count, read relative to the present raw count: it may have wrapped.
        span = settings.counter_span
        back = raw_index - axis.raw_counts
        if span:
            back = (back + span // 2) % span - span // 2
        index_m = axis.position_m + settings.metres_per_count * back
        shift = home(settings, axis, index_m, elapsed, t)
        if shift != 0.0:
            law.y1 += shift
            law.y2 += shift
    elif axis.state == RUNNING:
        follow(settings, axis, segments, segment_counts, tick, elapsed)
    elif axis.state == STOPPING and brake(settings, axis, elapsed):
        axis.state = FAULT if axis.fault else OFF
    if axis.state not in (OFF, FAULT):
        check_motion(settings, axis, elapsed, t)

    flags = SKIPPED if elapsed > 1 else 0
    u, v = 0.0, 0.0
    if axis.state in (OFF, FAULT):
        hold_where_it_is(axis)
        axis.fresh = 0
        law.d0 = 0.0
    else:
        # What depends on position is learned only where the position is known.
        law.blind = 0 if axis.homed else 1
        if axis.fresh:
            start_law(feedforward, law_settings, law, t, axis.position_m)
            axis.fresh = 0
        elif elapsed > 1:
            carry_over_gap(law, elapsed, axis.position_m)
        u = law_step(
            state_columns,
            input_columns,
            feedforward,
            input_map,
            input_slope,
            law_settings,
            law,
            t,
            axis.position_m,
            axis.reference_m,
            axis.reference_velocity_m_s,
            axis.reference_acceleration_m_s2,
        )
        u = checked_voltage(settings, axis, u, law.v, t)
        v = law.v
        if law.flags & LAW_SATURATED:
            flags |= SATURATED
        if law.flags & LAW_ADAPTED:
            flags |= ADAPTING
        if law.flags & LAW_PROJECTED:
            flags |= PROJECTED
    if axis.homed:
        flags |= HOMED
    status = axis.status
    if status & DEVICE_LIMIT_NEGATIVE:
        flags |= LIMIT_NEGATIVE
    if status & DEVICE_LIMIT_POSITIVE:
        flags |= LIMIT_POSITIVE
    if status & DEVICE_HOME_SWITCH:
        flags |= HOME_SWITCH
    if status & DEVICE_INDEX:
        flags |= INDEX

    sample.reference_m = axis.reference_m
    sample.reference_velocity_m_s = axis.reference_velocity_m_s
    sample.reference_acceleration_m_s2 = axis.reference_acceleration_m_s2
    sample.position_m = axis.position_m
    sample.velocity_m_s = axis.velocity_m_s
    sample.following_error_m = axis.position_m - axis.reference_m
    sample.command_v = u
    sample.virtual_command_v = v
    sample.d0_hat_v = law.d0
    for i in range(law_settings.n):
        sample.theta_hat[i] = law.theta[i]
    sample.state = axis.state
    sample.fault = axis.fault
    sample.flags = flags
    return u


@njit
def report_axis(axis: Any, sample: Any, n: int, status: Any) -> None:
    """Copy what `status` shows of an axis."""
    status.fault = axis.fault
    status.homed = axis.homed
    status.slot = axis.slot
    status.position_m = sample.position_m
    status.velocity_m_s = sample.velocity_m_s
    status.reference_m = sample.reference_m
    status.reference_velocity_m_s = sample.reference_velocity_m_s
    status.following_error_m = sample.following_error_m
    status.command_v = sample.command_v
    status.d0_hat_v = sample.d0_hat_v
    for i in range(n):
        status.theta_hat[i] = sample.theta_hat[i]
    status.fault_value = axis.fault_value
    status.fault_limit = axis.fault_limit
    status.fault_time_s = axis.fault_time_s
    status.state = axis.state  # last: whoever sees FAULT finds its cause
