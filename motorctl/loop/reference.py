"""What an axis should do in this tick: hold, follow a program, or ramp down."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.states import Event, take
from motorctl.motion import advance, evaluate, velocity_ramp_distance, velocity_ramp_step

UNDECIDED, GENTLE, HARD = 0, 1, 2


@inner_kernel
def hold_where_it_is(axis: Any) -> None:
    """Make the present position the reference, at rest."""
    axis.reference_m = axis.position_m
    axis.reference_velocity_m_s = 0.0
    axis.reference_acceleration_m_s2 = 0.0


@inner_kernel
def start_from_motion(settings: Any, axis: Any) -> None:
    """Make the present motion the reference: place and speed of the axis, no acceleration.

    A place that was only held meanwhile is where the axis was; it has gone on since.
    """
    fastest = settings.max_velocity_m_s
    if axis.held_ticks and not settings.predict:
        axis.position_m += axis.velocity_m_s * axis.held_ticks * settings.period_s
    axis.reference_m = axis.position_m
    axis.reference_velocity_m_s = min(max(axis.velocity_m_s, -fastest), fastest)
    axis.reference_acceleration_m_s2 = 0.0
    axis.drift_m_s, axis.error_count = 0.0, 0


@inner_kernel
def ramp(settings: Any, axis: Any, velocity: float, elapsed: int) -> bool:
    """Move the reference's velocity towards `velocity`; return whether it is reached."""
    acceleration, jerk = settings.stop_acceleration_m_s2, settings.stop_jerk_m_s3
    return _ramp(settings, axis, velocity, acceleration, jerk, elapsed)


@inner_kernel
def brake(settings: Any, axis: Any, elapsed: int) -> bool:
    """Ramp down to rest; return whether the axis has come to it.

    With the limits of a stop, unless that would end beyond the travel, or turn back on the way
    because the axis already brakes harder. Then with the axis' own limits: a program that keeps
    these comes to rest within the travel, so the hardest braking does so too.
    """
    if axis.brake == UNDECIDED:
        axis.brake = GENTLE if _stops_gently(settings, axis) else HARD
    if axis.brake == GENTLE:
        return ramp(settings, axis, 0.0, elapsed)
    acceleration, jerk = settings.max_acceleration_m_s2, settings.max_jerk_m_s3
    return _ramp(settings, axis, 0.0, acceleration, jerk, elapsed)


@inner_kernel
def _stops_gently(settings: Any, axis: Any) -> bool:
    x, v = axis.reference_m, axis.reference_velocity_m_s
    a, jerk = axis.reference_acceleration_m_s2, settings.stop_jerk_m_s3
    if v * a < 0.0 and a * a > 2.0 * jerk * abs(v):
        return False
    if not axis.homed:
        return True
    end = x + velocity_ramp_distance(v, a, 0.0, settings.stop_acceleration_m_s2, jerk)
    return min(settings.travel_low_m, x) <= end <= max(settings.travel_high_m, x)  # type: ignore[no-any-return]


@inner_kernel
def _ramp(
    settings: Any, axis: Any, velocity: float, acceleration: float, jerk: float, elapsed: int
) -> bool:
    axis.ramp_velocity_m_s = velocity
    axis.ramp_acceleration_m_s2, axis.ramp_jerk_m_s3 = acceleration, jerk
    for _ in range(elapsed):
        v, a, dx = velocity_ramp_step(
            axis.reference_velocity_m_s,
            axis.reference_acceleration_m_s2,
            velocity,
            acceleration,
            jerk,
            settings.period_s,
        )
        axis.reference_m += dx
        axis.reference_velocity_m_s = v
        axis.reference_acceleration_m_s2 = a
    reached = axis.reference_velocity_m_s == velocity
    return reached and axis.reference_acceleration_m_s2 == 0.0  # type: ignore[no-any-return]


@inner_kernel
def follow(settings: Any, axis: Any, segments: Any, counts: Any, tick: int, elapsed: int) -> None:
    """Advance the program by the periods that passed; at its end the axis holds."""
    if tick < axis.start_tick:
        return
    table, count = segments[axis.slot], counts[axis.slot]
    # The start may lie between the axis' last tick and this one. Starts count the loop's ticks.
    passed_s = min(elapsed * settings.divisor, tick - axis.start_tick) * settings.tick_s
    index, time_s, done = advance(table, count, axis.segment, axis.segment_time_s, passed_s)
    axis.segment, axis.segment_time_s = index, time_s
    x, v, a = evaluate(table, count, axis.segment, axis.segment_time_s)
    axis.reference_m = x
    axis.reference_velocity_m_s = v
    axis.reference_acceleration_m_s2 = a
    if done:
        take(axis, Event.PROGRAM_ENDS)
        axis.slot, axis.program = -1, 0
        axis.reference_velocity_m_s = 0.0
        axis.reference_acceleration_m_s2 = 0.0
