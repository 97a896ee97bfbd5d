"""Guards of the command: no number, beyond the limit, at the limit for too long, too much heat."""

from __future__ import annotations

import math
from typing import Any

from motorctl.config.motor_heat import warmed
from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import COOLED_RATIO
from motorctl.loop.guards.reactions import react, trip
from motorctl.loop.states import State

_warmed = inner_kernel(warmed)


@inner_kernel
def checked_voltage(settings: Any, axis: Any, u: float, v: float, t: float) -> float:
    """Return the command that may leave: within the voltage limit, zero where the axis tripped.

    v is the virtual command that u was found for.
    """
    if not (math.isfinite(u) and math.isfinite(v)):
        trip(axis, FaultCause.NOT_A_NUMBER, 0.0, settings.max_voltage_v, t)
    if axis.state == State.FAULT:
        return 0.0
    return min(max(u, -settings.max_voltage_v), settings.max_voltage_v)  # type: ignore[no-any-return]


@inner_kernel
def warm(settings: Any, axis: Any, elapsed: int) -> None:
    """Let the motor's model warm or cool by what the last command did, enabled or not."""
    if settings.continuous_voltage_v > 0.0:
        kept = settings.heat_kept if elapsed == 1 else settings.heat_kept**elapsed
        axis.heat_v2 = _warmed(axis.heat_v2, axis.command_v, kept)


@inner_kernel
def check_command(settings: Any, axis: Any, elapsed: int, t: float) -> None:
    """Trip where the command has been at its limit for too long, or has warmed the motor up.

    A tick below the limit takes back one at it: an axis that swings from limit to limit is there
    for no long time at once.
    """
    at_limit = abs(axis.command_v) >= settings.max_voltage_v
    axis.saturated_ticks = max(0, axis.saturated_ticks + (elapsed if at_limit else -elapsed))
    if settings.saturation_ticks and axis.saturated_ticks > settings.saturation_ticks:
        passed_s = axis.saturated_ticks * settings.period_s
        allowed_s = settings.saturation_ticks * settings.period_s
        react(settings, axis, FaultCause.SATURATION, passed_s, allowed_s, t)
    limit_v = settings.continuous_voltage_v
    if limit_v > 0.0 and axis.heat_v2 > limit_v * limit_v:
        react(settings, axis, FaultCause.THERMAL, math.sqrt(axis.heat_v2), limit_v, t)


@inner_kernel
def is_hot(settings: Any, axis: Any) -> bool:
    """Return whether the motor has not cooled down enough since it was too warm."""
    cool_v = COOLED_RATIO * settings.continuous_voltage_v
    return axis.fault == FaultCause.THERMAL and axis.heat_v2 > cool_v * cool_v  # type: ignore[no-any-return]


@inner_kernel
def has_lost_its_numbers(axis: Any, law: Any) -> bool:
    """Return whether an axis tripped on no number while what the law has learned is none, either.

    Every start goes on from that: it would trip again at once.
    """
    if axis.fault != FaultCause.NOT_A_NUMBER:
        return False
    for i in range(law.theta.size):
        if not (math.isfinite(law.theta[i]) and math.isfinite(law.D[i])):
            return True
        for k in range(i + 1, law.theta.size):
            if not math.isfinite(law.U[i, k]):
                return True
    return False
