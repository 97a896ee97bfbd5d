"""Guards of the encoder: whether what it counts can be motion."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.axis_records import JUMP_SPEED_RATIO, OVERSPEED_RATIO
from motorctl.loop.guards.reactions import trip

OFF = int(AxisState.OFF)
CAUSE_ENCODER_JUMP = int(FaultCause.ENCODER_JUMP)


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
def jump(settings: Any, axis: Any, step: int, t: float) -> None:
    """Note that the count went where no motion leads."""
    if axis.state != OFF:
        trip(axis, CAUSE_ENCODER_JUMP, step * settings.metres_per_count, 0.0, t)
    axis.homed = settings.absolute
