"""Guards of the motion: speed, soft limits, limit switches, following error."""

from __future__ import annotations

from typing import Any

from motorctl.config.count_limits import too_fast_m_s
from motorctl.config.guard_keys import OVERSPEED_TICKS
from motorctl.hal import Status
from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import STANDSTILL_RATIO
from motorctl.loop.guards.reactions import react, trip
from motorctl.loop.states import State

LIMIT_NEGATIVE = int(Status.LIMIT_NEGATIVE)
LIMIT_POSITIVE = int(Status.LIMIT_POSITIVE)

_too_fast_m_s = inner_kernel(too_fast_m_s)


@inner_kernel
def still_moves(settings: Any, axis: Any) -> bool:
    """Return whether the axis moves too fast to be enabled: holding it would be a jolt."""
    noise = 8.0 * abs(settings.metres_per_count) / settings.period_s
    return abs(axis.velocity_m_s) > STANDSTILL_RATIO * settings.max_velocity_m_s + noise  # type: ignore[no-any-return]


@inner_kernel
def is_too_fast(settings: Any, axis: Any) -> bool:
    """Return whether an axis that tripped on its speed still has it."""
    fastest = _fastest_m_s(settings)
    return axis.fault == FaultCause.OVERSPEED and abs(axis.velocity_m_s) > fastest  # type: ignore[no-any-return]


@inner_kernel
def _fastest_m_s(settings: Any) -> float:
    return _too_fast_m_s(
        settings.max_velocity_m_s, abs(settings.metres_per_count), settings.period_s
    )


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
def is_blocked(axis: Any) -> bool:
    """Return whether the limit switch that the reference moves towards is pressed."""
    ahead = LIMIT_NEGATIVE if axis.reference_velocity_m_s < 0.0 else LIMIT_POSITIVE
    return axis.reference_velocity_m_s != 0.0 and axis.status & ahead != 0  # type: ignore[no-any-return]


@inner_kernel
def _end_ahead_m(settings: Any, axis: Any) -> float:
    backwards = axis.reference_velocity_m_s < 0.0
    return settings.travel_low_m if backwards else settings.travel_high_m  # type: ignore[no-any-return]


@inner_kernel
def check_motion(settings: Any, axis: Any, elapsed: int, t: float) -> None:
    """Trip on speed, soft limits, limit switches and following error.

    A tick within the following error takes back one beyond it: an axis that swings through its
    reference is beyond for no long time at once.
    """
    x, v = axis.position_m, axis.velocity_m_s
    fastest = _fastest_m_s(settings)
    if not axis.held_ticks:  # a speed that is only held, or predicted, says nothing new
        axis.fast_count = axis.fast_count + 1 if abs(v) > fastest else 0
    if axis.fast_count >= OVERSPEED_TICKS:
        react(settings, axis, FaultCause.OVERSPEED, v, fastest, t)
    if axis.homed:
        _tighten_soft_limits(settings, axis)
        if x < axis.soft_low_m:
            react(settings, axis, FaultCause.SOFT_LIMIT, x, axis.soft_low_m, t)
        elif x > axis.soft_high_m:
            react(settings, axis, FaultCause.SOFT_LIMIT, x, axis.soft_high_m, t)
    if is_blocked(axis):
        if axis.state == State.HOMING:  # it does not know its place, and may not be moved back
            trip(axis, FaultCause.HOMING_FAILED, x, 0.0, t)
        else:
            react(settings, axis, FaultCause.LIMIT_SWITCH, x, _end_ahead_m(settings, axis), t)
    error = x - axis.reference_m
    allowed = settings.following_error_minimum_m + settings.following_error_per_velocity_s * abs(
        axis.reference_velocity_m_s
    )
    axis.error_count = max(0, axis.error_count + (elapsed if abs(error) > allowed else -elapsed))
    if axis.error_count > settings.error_ticks:
        if axis.fault:  # a ramp that is not followed either is none
            trip(axis, FaultCause.FOLLOWING_ERROR, error, allowed, t)
        else:
            react(settings, axis, FaultCause.FOLLOWING_ERROR, error, allowed, t)
