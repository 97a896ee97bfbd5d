"""Ticks without a new sample: the last position is held, or the model moves it on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.axis_records import (
    DOUBT_ACCELERATION_RATIO,
    DOUBT_PERIODS,
    DOUBT_TICKS,
    MISSED_ACCELERATION_RATIO,
    MOST_DOUBT,
    MOST_DOUBTED_TICKS,
)
from motorctl.loop.guards.encoder import count_is_ambiguous
from motorctl.loop.states import State, is_enabled


@inner_kernel(error_model="numpy")
def predict_motion(
    feedforward: Callable[..., float], settings: Any, axis: Any, law: Any, elapsed: int, t: float
) -> tuple[float, float]:
    """Return the position and the velocity that the model expects now.

    It solves the force balance of the list, under the last virtual command, for the acceleration:
    v + d0_hat = theta1 a + the rest of the list at the last x and v.
    """
    dt = elapsed * settings.period_s
    x, v = axis.position_m, axis.velocity_m_s
    if not axis.held_ticks:
        v = axis.reference_velocity_m_s + axis.drift_m_s
    rest = feedforward(x, v, 0.0, v, t, law.context, law.theta)
    inertia = feedforward(x, v, 1.0, v, t, law.context, law.theta) - rest
    a = (law.v + law.d0 - rest) / inertia
    bound = settings.max_acceleration_m_s2
    a = min(max(a, -bound), bound) if math.isfinite(a) else 0.0
    return x + dt * (v + 0.5 * dt * a), v + dt * a


@inner_kernel
def is_old(settings: Any, elapsed: int, behind: int) -> bool:
    """Return whether a sample that came may be older than the law takes it for.

    elapsed counts the axis' periods since its last tick, behind the loop's by which the read ended
    too late.
    """
    # A pause between waking and reading: nobody knows when in it the sample was taken.
    if behind >= settings.divisor:
        return True
    # After skipped periods one exchange a period brings what was sampled before them.
    return settings.exchange and elapsed > 1


@inner_kernel
def counter_step(settings: Any, before: int, raw: int) -> int:
    """Return how far the counter went, its wrap undone."""
    step = raw - before
    span = settings.counter_span
    if span:
        step = (step + span // 2) % span - span // 2
    return step


@inner_kernel
def place_of(correct: Callable[..., float], settings: Any, axis: Any, counts: int) -> float:
    """Return the position that a count means, without the declared errors of the measurement.

    These are known by their place in the machine, so only where the axis knows its own.
    """
    y: float = settings.metres_per_count * counts + settings.offset_m + axis.shift_m
    return correct(y) if axis.homed else y


@inner_kernel
def is_unexpected(
    correct: Callable[..., float], settings: Any, axis: Any, raw: int, elapsed: int
) -> bool:
    """Return whether a sample is one that no motion explains: taken at another time, or damaged.

    A jump that is no motion at all is a fault, not this. Where device and loop have clocks of
    their own, samples move by a period now and then, and nothing is expected.
    """
    if not (settings.asked and predicts(settings, axis)):
        return False
    step = counter_step(settings, axis.raw_counts, raw)
    ticks = axis.blind_ticks + elapsed
    if count_is_ambiguous(settings, axis, step, ticks):
        return False
    unit = abs(settings.metres_per_count)
    passed_s, since_s = elapsed * settings.period_s, ticks * settings.period_s
    y = place_of(correct, settings, axis, axis.counts + step)
    # One sample that came early or late says much of the speed.
    v = axis.velocity_m_s if axis.held_ticks else axis.reference_velocity_m_s + axis.drift_m_s
    expected = axis.position_m + passed_s * v
    jerked = DOUBT_ACCELERATION_RATIO * passed_s**2 + MISSED_ACCELERATION_RATIO * since_s**2
    reach = DOUBT_PERIODS * abs(v) * settings.period_s
    reach += jerked * settings.possible_acceleration_m_s2 + 8.0 * unit
    return abs(y - expected) > reach  # type: ignore[no-any-return]


@inner_kernel
def may_be_doubted(settings: Any, axis: Any, elapsed: int) -> bool:
    """Return whether a sample may be left out: one between two that are believed, and not often.

    Homing is slow, and looks for edges that one sample may bring.
    """
    longest = min(MOST_DOUBTED_TICKS, settings.hold_ticks)
    seldom = axis.doubt_level <= MOST_DOUBT and axis.doubted_ticks == 0
    known = axis.trust_ticks == 0 and axis.state != State.HOMING
    return seldom and known and elapsed <= longest  # type: ignore[no-any-return]


@inner_kernel
def just_left_out(axis: Any) -> bool:
    """Return whether the last sample came in the last tick, and was left out."""
    return (  # type: ignore[no-any-return]
        axis.doubted_ticks > 0 and axis.blind_ticks == axis.doubted_blind_ticks
    )


@inner_kernel
def predicts(settings: Any, axis: Any) -> bool:
    """Return whether the model stands in for samples that do not come."""
    moving = is_enabled(axis) and not axis.fresh
    return settings.predict and axis.have_counts and moving


@inner_kernel
def hold_position(
    feedforward: Callable[..., float], settings: Any, axis: Any, law: Any, elapsed: int, t: float
) -> None:
    """Do without a new sample: the last position stands, or the model moves it on."""
    if predicts(settings, axis):
        x, v = predict_motion(feedforward, settings, axis, law, elapsed, t)
        axis.position_m, axis.velocity_m_s = x, v
    axis.held_ticks += elapsed
    axis.blind_ticks += elapsed
    axis.missed_ticks += elapsed
    if axis.have_counts:
        axis.longest_missed_ticks = max(axis.longest_missed_ticks, axis.held_ticks)
    else:  # there is no last position
        axis.held_ticks = max(axis.held_ticks, settings.hold_ticks + 1)


@inner_kernel
def leave_out(
    correct: Callable[..., float],
    feedforward: Callable[..., float],
    settings: Any,
    axis: Any,
    law: Any,
    raw: int,
    elapsed: int,
    t: float,
) -> None:
    """Doubt a sample: the model's prediction stands, and what came is kept for the next tick."""
    hold_position(feedforward, settings, axis, law, elapsed, t)
    y = place_of(
        correct, settings, axis, axis.counts + counter_step(settings, axis.raw_counts, raw)
    )
    axis.doubted_ticks += elapsed
    axis.paused_ticks += elapsed - 1
    axis.doubt_level += DOUBT_TICKS
    axis.doubted_raw_counts, axis.doubted_blind_ticks = raw, axis.blind_ticks
    axis.doubted_miss_m = y - axis.position_m
