"""Guards of the encoder: whether what it counts can be motion, and is there at all."""

from __future__ import annotations

from typing import Any

from motorctl.config import count_limits
from motorctl.config.guard_keys import OVERSPEED_RATIO
from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import StallLimit
from motorctl.loop.guards.reactions import trip, trip_on_stall
from motorctl.loop.states import is_off

_ambiguous_counts = inner_kernel(count_limits.ambiguous_counts)
BY_COUNTER = int(StallLimit.COUNTER)
_longest_step_m = inner_kernel(count_limits.longest_step_m)


@inner_kernel
def count_is_ambiguous(settings: Any, axis: Any, step: int, elapsed: int) -> bool:
    """Return whether a step of the counter is too large to be motion, or may hide whole turns.

    elapsed counts the periods since the last count that could be trusted.
    """
    seconds = settings.period_s * elapsed
    unit = abs(settings.metres_per_count)
    span = settings.counter_span
    if span:
        if abs(step) >= _ambiguous_counts(span):
            return True
        fastest = OVERSPEED_RATIO * settings.max_velocity_m_s
        if not axis.blind_ticks:
            gained = 2.0 * settings.max_acceleration_m_s2 * seconds
            fastest = min(fastest, abs(axis.velocity_m_s) + gained)
        if elapsed > 1 and fastest * seconds >= 0.75 * span * unit:
            return True
    return abs(step) * unit > longest_step_m(settings, elapsed)  # type: ignore[no-any-return]


@inner_kernel
def longest_step_m(settings: Any, elapsed: int) -> float:
    """Return the longest step of the count that may be motion [m], in so many periods."""
    unit, seconds = abs(settings.metres_per_count), settings.period_s * elapsed
    return _longest_step_m(settings.max_velocity_m_s, unit, seconds)


@inner_kernel
def jump(settings: Any, axis: Any, step: int, elapsed: int, paused: int, t: float) -> None:
    """Note that the count went where no motion leads, or that a pause hides how far it went.

    elapsed counts the axis' periods since the last count that could be trusted, paused those of
    them in which the loop was stalled: where motion may have carried the counter a quarter round in
    these, the pause is the cause, not the encoder.
    """
    if not is_off(axis):
        fastest = OVERSPEED_RATIO * settings.max_velocity_m_s
        quarter_m = _ambiguous_counts(settings.counter_span) * abs(settings.metres_per_count)
        longest = quarter_m / (fastest * settings.period_s)
        if settings.counter_span and paused and paused + 1 >= longest:
            trip_on_stall(axis, float(paused), float(int(longest)), BY_COUNTER, t)
        else:
            limit_m = longest_step_m(settings, elapsed)
            if settings.counter_span:
                limit_m = min(limit_m, quarter_m)
            trip(axis, FaultCause.ENCODER_JUMP, step * settings.metres_per_count, limit_m, t)
    axis.homed = settings.absolute


@inner_kernel
def note_step(axis: Any, step: int, follows: bool) -> None:
    """Keep by how much a step of the count differs from that of the tick before, if it follows.

    Every sample that came counts, also one that is left out: it was measured.
    """
    axis.bend_counts = step - axis.step_counts if axis.steps_follow and follows else 0
    axis.step_counts, axis.steps_follow = step, follows


@inner_kernel
def leave_unwatched(axis: Any, moved_m: float) -> None:
    """Let motion of the reference that the axis was not led along count for nothing."""
    axis.stuck_reference_m += moved_m


@inner_kernel
def begin_watching(axis: Any) -> None:
    """Forget what the encoder did before now: the axis is enabled, or its place is another."""
    axis.stuck_counts, axis.stuck_reference_m = axis.counts, axis.reference_m
    axis.bend_m2 = 0.0


@inner_kernel
def check_encoder(settings: Any, axis: Any, sampled: bool, t: float) -> None:
    """Trip where the count stands still while the reference moves, or trembles while it does not.

    Only new samples count, so that neither a pause of the computer nor a silent bus is taken for
    an encoder that is stuck. An axis that is blocked looks the same as one whose encoder is stuck.
    sampled: one came in this tick, though it may have been left out.
    """
    if not axis.held_ticks:
        if abs(axis.counts - axis.stuck_counts) > 1:
            axis.stuck_counts, axis.stuck_reference_m = axis.counts, axis.reference_m
        elif settings.stuck_distance_m > 0.0:
            moved = abs(axis.reference_m - axis.stuck_reference_m)
            if moved > settings.stuck_distance_m:
                trip(axis, FaultCause.ENCODER_STUCK, moved, settings.stuck_distance_m, t)
    if sampled and settings.noise_rms_m > 0.0 and axis.reference_velocity_m_s == 0.0:
        # In motion, a sample that is late by a part of a period would look like noise.
        watch_noise(settings, axis)
        if axis.bend_m2 > settings.noise_rms_m**2:
            trip(axis, FaultCause.ENCODER_NOISE, axis.bend_m2**0.5, settings.noise_rms_m, t)


@inner_kernel
def watch_noise(settings: Any, axis: Any) -> None:
    """Take the last sample into the mean square of the second difference."""
    bend_m = axis.bend_counts * settings.metres_per_count
    bend_m2 = bend_m * bend_m
    if settings.predict:
        bend_m2 = min(bend_m2, settings.noise_most_m2)
    axis.bend_m2 += settings.noise_share * (bend_m2 - axis.bend_m2)


@inner_kernel
def trembles(settings: Any, axis: Any) -> bool:
    """Return whether an axis that tripped on its encoder's noise still has it."""
    noisy = axis.bend_m2 > settings.noise_rms_m**2
    return axis.fault == FaultCause.ENCODER_NOISE and noisy  # type: ignore[no-any-return]
