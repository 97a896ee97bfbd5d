"""One tick of one axis: counts in, state machine, law, limits, volts out, sample written."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from motorctl.config.guard_keys import OVERSPEED_RATIO
from motorctl.control import LawFlag, carry_over_gap, law_step, shift_law, start_law
from motorctl.hal import Status
from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause, SampleFlag
from motorctl.loop.axis_records import DRIFT_WEIGHT, TRUSTED_TICKS
from motorctl.loop.excitation import excitation_voltage
from motorctl.loop.guards.command import check_command, checked_voltage, warm
from motorctl.loop.guards.device import (
    COMMUNICATION_LOST,
    DEVICE_FAULTS,
    ENCODER_LOST,
    FORGET_PLACE,
    check_device,
    check_freshness,
    forget_place,
)
from motorctl.loop.guards.encoder import (
    begin_watching,
    check_encoder,
    count_is_ambiguous,
    jump,
    leave_unwatched,
    note_step,
    watch_noise,
)
from motorctl.loop.guards.motion import check_motion, set_soft_limits
from motorctl.loop.guards.readiness import check_readiness, waits_for_power
from motorctl.loop.guards.supervision import check_pause, forget_stall, note_pause
from motorctl.loop.homing import home
from motorctl.loop.missed_samples import (
    counter_step,
    hold_position,
    is_old,
    is_unexpected,
    just_left_out,
    leave_out,
    may_be_doubted,
    place_of,
    predict_motion,
    predicts,
)
from motorctl.loop.reference import UNDECIDED, brake, follow, hold_where_it_is, start_from_motion
from motorctl.loop.states import TOLD, Event, State, is_enabled, is_off, is_stopping, take

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
HELD = int(SampleFlag.HELD)
LEFT_OUT = int(SampleFlag.LEFT_OUT)
BETWEEN = int(SampleFlag.BETWEEN)
STALE = int(Status.STALE)
UNTRUSTED = ENCODER_LOST | COMMUNICATION_LOST
NOT_FOLLOWING = (
    FaultCause.FOLLOWING_ERROR,
    FaultCause.SATURATION,
    FaultCause.OVERRUN,
    FaultCause.HOST_FROZEN,
)
DEVICE_LIMIT_NEGATIVE = int(Status.LIMIT_NEGATIVE)
DEVICE_LIMIT_POSITIVE = int(Status.LIMIT_POSITIVE)
DEVICE_HOME_SWITCH = int(Status.HOME_SWITCH)
DEVICE_INDEX = int(Status.INDEX_LATCHED)


@inner_kernel
def locate(correct: Callable[..., float], settings: Any, axis: Any) -> None:
    """Set the position from the count."""
    axis.position_m = place_of(correct, settings, axis, axis.counts)


@inner_kernel(error_model="numpy")
def read_position(
    correct: Callable[..., float], settings: Any, axis: Any, raw: int, elapsed: int, t: float
) -> None:
    """Unwrap the counter into a position and a velocity; a step too large is a fault.

    After one an absolute encoder's count is taken anew from the next sample.
    """
    paused = axis.paused_ticks + max(elapsed - 1, 0)
    elapsed += axis.blind_ticks
    axis.paused_ticks = 0
    if not axis.have_counts:
        axis.have_counts, axis.counts, axis.raw_counts = 1, raw, raw
        axis.velocity_m_s, axis.blind_ticks = 0.0, 0
        span = settings.counter_span
        travel_m = settings.travel_high_m - settings.travel_low_m
        if settings.absolute and span * abs(settings.metres_per_count) >= travel_m:
            # Signed or not, the counter means a place in or near the travel.
            middle = 0.5 * (settings.travel_low_m + settings.travel_high_m) - settings.offset_m
            axis.counts += span * round((middle / settings.metres_per_count - raw) / span)
        locate(correct, settings, axis)
        return
    step = counter_step(settings, axis.raw_counts, raw)
    if count_is_ambiguous(settings, axis, step, elapsed):
        jump(settings, axis, step, elapsed, paused, t)
        axis.have_counts = 1 - settings.absolute
    axis.blind_ticks = 0
    axis.raw_counts = raw
    axis.counts += step
    axis.velocity_m_s = settings.metres_per_count * step / (settings.period_s * elapsed)
    drift = axis.velocity_m_s - axis.reference_velocity_m_s
    axis.drift_m_s += DRIFT_WEIGHT * (drift - axis.drift_m_s)
    locate(correct, settings, axis)


@inner_kernel
def lose_sight(settings: Any, axis: Any, elapsed: int) -> None:
    """Hold the last position where the count cannot be trusted, and know what that costs."""
    axis.blind_ticks += elapsed
    axis.paused_ticks += elapsed - 1
    axis.velocity_m_s = 0.0
    if settings.absolute:
        axis.have_counts = 0
    elif axis.status & ENCODER_LOST:
        axis.homed = 0


@inner_kernel
def forget_pause(axis: Any) -> None:
    """Note that a sample came."""
    axis.held_ticks, axis.held_status, axis.doubted_ticks = 0, 0, 0


@inner_kernel
def axis_inputs(
    correct: Callable[..., float],
    feedforward: Callable[..., float],
    settings: Any,
    axis: Any,
    law: Any,
    raw: int,
    status: int,
    elapsed: int,
    behind: int,
    t: float,
) -> None:
    """Take what the driver read, before any command is looked at.

    elapsed counts the axis' periods since its last tick, behind the loop's whole periods by which
    the read ended too late.
    """
    if status & FORGET_PLACE:
        forget_place(settings, axis)
    axis.status = status & ~FORGET_PLACE
    old = is_old(settings, elapsed, behind)
    note_pause(settings, axis, elapsed, behind)
    if not is_off(axis):
        check_device(settings, axis, t)
    if status & UNTRUSTED:
        forget_pause(axis)
        lose_sight(settings, axis, elapsed)
    elif status & STALE or old:
        axis.held_status |= status
        # The device has answered, and a new sample is a tick away: whether the loop was stalled for
        # too long is `check_pause`'s to say.
        only_stalled = settings.exchange and not status & STALE and axis.held_ticks <= 1
        axis.paused_ticks += elapsed - 1 if status & STALE else elapsed
        hold_position(feedforward, settings, axis, law, elapsed, t)
        if not (is_off(axis) or only_stalled):
            check_freshness(settings, axis, elapsed, t)
    else:
        if status & DEVICE_FAULTS == 0:
            forget_stall(axis, elapsed, behind)
        again = just_left_out(axis)
        before = axis.doubted_raw_counts if again else axis.raw_counts
        follows = axis.have_counts != 0 and elapsed == 1 and (again or axis.blind_ticks == 0)
        note_step(axis, counter_step(settings, before, raw), follows)
        axis.step_ticks = elapsed + axis.blind_ticks
        unexpected = is_unexpected(correct, settings, axis, raw, elapsed)
        if unexpected and may_be_doubted(settings, axis, elapsed):
            leave_out(correct, feedforward, settings, axis, law, raw, elapsed, t)
        else:
            believe(correct, feedforward, settings, axis, law, raw, elapsed, unexpected, t)


@inner_kernel
def believe(
    correct: Callable[..., float],
    feedforward: Callable[..., float],
    settings: Any,
    axis: Any,
    law: Any,
    raw: int,
    elapsed: int,
    unexpected: bool,
    t: float,
) -> None:
    """Take a sample for true, after ticks that did without one, too."""
    predicted = axis.held_ticks and predicts(settings, axis)
    expected = axis.position_m
    if predicted:
        expected, _ = predict_motion(feedforward, settings, axis, law, elapsed, t)
    confirmed = False
    if just_left_out(axis):
        step = counter_step(settings, axis.doubted_raw_counts, raw)
        if unexpected and count_is_ambiguous(settings, axis, step, elapsed):
            jump(settings, axis, step, elapsed, elapsed - 1, t)
        y = place_of(
            correct, settings, axis, axis.counts + counter_step(settings, axis.raw_counts, raw)
        )
        confirmed = unexpected and (y - expected) * axis.doubted_miss_m > 0.0
    forget_pause(axis)
    if confirmed:
        # The last one was true as well, so the law sees the speed between the two.
        law.y1 += axis.doubted_miss_m
        before, passed = axis.counts, axis.blind_ticks + elapsed
        read_position(correct, settings, axis, axis.doubted_raw_counts, 0, t)
        read_position(correct, settings, axis, raw, elapsed, t)
        moved = settings.metres_per_count * (axis.counts - before)
        fastest = OVERSPEED_RATIO * settings.max_velocity_m_s
        speed = min(max(moved / (passed * settings.period_s), -fastest), fastest)
        axis.drift_m_s = speed - axis.reference_velocity_m_s
    else:
        read_position(correct, settings, axis, raw, elapsed, t)
        if predicted:
            # What the prediction missed is an error of the position, not a speed.
            law.y1 += axis.position_m - expected
            law.y2 += axis.position_m - expected
    axis.trust_ticks = TRUSTED_TICKS if unexpected else max(0, axis.trust_ticks - elapsed)
    axis.doubt_level = max(0, axis.doubt_level - elapsed)


@inner_kernel
def axis_reference(
    correct: Callable[..., float],
    feedforward: Callable[..., float],
    advance_context: Callable[..., None],
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
) -> None:
    """Move the axis' state machine and its reference on by a tick, and check its motion.

    elapsed counts the periods since the last tick: 1, or more after an overrun.
    """
    before_m, before, rested = axis.reference_m, axis.state, False
    if is_enabled(axis) and check_pause(settings, axis, elapsed, t):
        begin_quick_stop(settings, axis, law, elapsed)  # the old reference leads nowhere
        before_m = axis.reference_m
    elif axis.state == State.HOMING:
        if axis.homed:  # homing begins: from here on its place is not known
            axis.homed = 0
            move_place(correct, feedforward, advance_context, settings, axis, law_settings, law, t)
            before_m = axis.reference_m
        # The index mark's count, read relative to the last raw count: it may have wrapped. Not
        # relative to the position, which may be a prediction.
        back = counter_step(settings, axis.raw_counts, raw_index)
        index_m = settings.metres_per_count * (axis.counts + back)
        index_m += settings.offset_m + axis.shift_m
        if home(settings, axis, index_m, elapsed, t):
            move_place(correct, feedforward, advance_context, settings, axis, law_settings, law, t)
            before_m = axis.reference_m
    elif axis.state == State.FOLLOWING:
        follow(settings, axis, segments, segment_counts, tick, elapsed)
    elif is_stopping(axis):
        rested = brake(settings, axis, elapsed)
    elif waits_for_power(axis):
        hold_where_it_is(axis)
    if is_enabled(axis):
        sampled = axis.held_ticks == 0 or just_left_out(axis)
        not_led = elapsed if axis.held_ticks else elapsed - 1
        leave_unwatched(axis, (axis.reference_m - before_m) * not_led / elapsed)
        check_encoder(settings, axis, sampled, t)
        check_motion(settings, axis, elapsed, t)
        check_command(settings, axis, elapsed, t)
        begin_quick_stop(settings, axis, law, elapsed)
    if rested and axis.state == before:  # no guard has stopped it otherwise
        take(axis, Event.AT_REST)
    if not is_enabled(axis):
        hold_where_it_is(axis)
        if axis.fault == FaultCause.ENCODER_NOISE and axis.held_ticks == 0:
            watch_noise(settings, axis)
        check_readiness(settings, axis)


@inner_kernel
def move_place(
    correct: Callable[..., float],
    feedforward: Callable[..., float],
    advance_context: Callable[..., None],
    settings: Any,
    axis: Any,
    law_settings: Any,
    law: Any,
    t: float,
) -> None:
    """Give the axis the position that its count means now, its reference and its law with it."""
    before = axis.position_m
    locate(correct, settings, axis)
    shift = axis.position_m - before
    shift_law(feedforward, advance_context, law_settings, law, t, before, shift)
    axis.reference_m += shift
    begin_watching(axis)
    set_soft_limits(settings, axis)


@inner_kernel
def begin_quick_stop(settings: Any, axis: Any, law: Any, elapsed: int) -> None:
    """Prepare the ramp of an axis that a guard has just stopped; the next tick begins it.

    An axis that does not follow, or was not led for a while, is ramped down from where it is: the
    old reference would pull it on.
    """
    if not is_stopping(axis) or axis.brake != UNDECIDED:
        return
    if axis.fault in NOT_FOLLOWING:
        start_from_motion(settings, axis)
        passed_s = (elapsed + axis.gap_ticks) * settings.period_s
        law.xd1 = axis.reference_m - axis.reference_velocity_m_s * passed_s
        begin_watching(axis)
    brake(settings, axis, 0)


@inner_kernel
def axis_step(
    state_columns: Callable[..., None],
    input_columns: Callable[..., None],
    feedforward: Callable[..., float],
    input_map: Callable[..., float],
    input_slope: Callable[..., float],
    advance_context: Callable[..., None],
    advance_inputs: Callable[..., None],
    settings: Any,
    axis: Any,
    law_settings: Any,
    law: Any,
    excitation: Any,
    elapsed: int,
    t: float,
    sample: Any,
) -> float:
    """Return the voltage [V] for this tick; zero where the amplifier is disabled.

    The references of all axes, and what the law is told of them, stand before.
    """
    flags = SKIPPED if elapsed > 1 else 0
    warm(settings, axis, elapsed)
    u, v = 0.0, 0.0
    added = excitation_voltage(settings, axis, excitation, elapsed)
    if axis.held_ticks:
        flags |= HELD
        if just_left_out(axis):
            flags |= LEFT_OUT
    if not is_enabled(axis):
        axis.fresh, axis.gap_ticks = 0, 0
        law.d0 = 0.0
    else:
        # What depends on position is learned only where the position is known.
        law.blind = 0 if axis.homed else 1
        passed = elapsed + axis.gap_ticks
        if waits_for_power(axis):
            law.u, law.v, law.flags = 0.0, 0.0, 0
        elif axis.held_ticks and not (axis.fresh or settings.predict):
            # Without news the last command stands, as it does where periods are skipped.
            axis.gap_ticks = passed
            u, law.flags = law.u, 0
        else:
            axis.gap_ticks = 0
            if axis.fresh:
                start_law(feedforward, advance_context, law_settings, law, t, axis.position_m)
                axis.fresh = 0
                take(axis, Event.LAW_BEGINS)
            elif passed > 1:
                carry_over_gap(
                    advance_context,
                    advance_inputs,
                    law_settings,
                    law,
                    passed,
                    axis.position_m,
                    axis.reference_m,
                )
            if axis.held_ticks or axis.excitation_ticks:
                # A prediction teaches nothing; and a response is that of one loop, not of many.
                law.blind = 1
                law.steps = 0
            u = law_step(
                state_columns,
                input_columns,
                feedforward,
                input_map,
                input_slope,
                advance_context,
                advance_inputs,
                law_settings,
                law,
                t,
                axis.position_m,
                axis.reference_m,
                axis.reference_velocity_m_s,
                axis.reference_acceleration_m_s2,
            )
        if added != 0.0 and math.isfinite(u):
            # What a beam's skew loop needs is no excitation's to take.
            limit = law_settings.max_voltage_v
            u = min(max(u + added, -limit), limit)
            if abs(u) == limit:
                flags |= SATURATED
        u = checked_voltage(settings, axis, u, law.v, t)
        v = law.v
        if law.flags & LAW_SATURATED:
            flags |= SATURATED
        if law.flags & LAW_ADAPTED:
            flags |= ADAPTING
        if law.flags & LAW_PROJECTED:
            flags |= PROJECTED
    axis.command_v = u
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
    sample.excitation_v = added
    sample.d0_hat_v = law.d0
    for i in range(law_settings.n):
        sample.theta_hat[i] = law.theta[i]
    sample.state = TOLD[axis.state]
    sample.fault = axis.fault
    sample.flags = flags
    sample.device_status = status
    return u


@inner_kernel
def axis_between(axis: Any, sample: Any) -> None:
    """Change a copy of the axis' last row to that of a tick that is none of its own."""
    sample.state = TOLD[axis.state]
    sample.fault = axis.fault
    sample.flags |= BETWEEN


@inner_kernel
def report_axis(axis: Any, sample: Any, n: int, status: Any) -> None:
    """Copy all that `status` shows of an axis; the row is announced when the tick is published."""
    status.state = TOLD[axis.state]
    status.inner_state = axis.state
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
    status.heat_v2 = axis.heat_v2
    for i in range(n):
        status.theta_hat[i] = sample.theta_hat[i]
    status.excitation_left = 0
    if axis.excitation_ticks:
        status.excitation_left = axis.excitation_total - axis.excitation_passed
    status.fault_value = axis.fault_value
    status.fault_limit = axis.fault_limit
    status.fault_time_s = axis.fault_time_s
    status.fault_status = axis.fault_status
    status.device_status = axis.status
    status.held_ticks = axis.held_ticks
    status.missed_ticks = axis.missed_ticks
    status.longest_missed_ticks = axis.longest_missed_ticks
