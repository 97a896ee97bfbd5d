"""What the faults of one end of a beam with two motors have to be detected by, and when.

Like all that is expected it imports nothing of motorctl. The beam is two coupled masses; what the
loop does with their motors is known to be between two amounts, so the ticks are a range.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping

from motorctl_benchmarks.safety.expected import (
    ERROR_BEFORE,
    RAMP_UP_S,
    Expected,
    at_once,
    limit_switch,
    no_new_sample,
)
from motorctl_benchmarks.safety.setting import Beam, Setting

LONGEST_S = 0.5
"""[s] For so long a beam is looked for that cannot follow. Larger: a case may be late that nobody
would call detected; smaller: a case is refused whose motion speeds up late. A ramp to the speed of
a case takes less than 0.09 s."""


def end_stuck(case: Setting) -> Expected:
    """Expect the skew guard: the other end goes on, while this one seems to stand.

    The mean seems to lag, so that the law pushes on with what the skew loop leaves; the skew loop
    pulls the other end back.

    Where the axis is slow (homing) both have the time to hold the counts still instead. Then the
    following error grows, or the mean's count stands: whichever comes first.
    """
    beam, speed = _beam(case), abs(case.speed_m_s)
    fastest, slowest = _others_accelerations(beam, speed)
    low, high = (1.0 - ERROR_BEFORE) * beam.limit_m, (1.0 + ERROR_BEFORE) * beam.limit_m
    least = math.floor(case.limits.ticks(_time_s(low, speed, fastest))) - 1
    if case.state == "homing":
        # The mean goes half as far as the ends get apart.
        lag_m = (1.0 + ERROR_BEFORE) * (_allowed_m(case, speed) + 0.5 * beam.limit_m)
        most = math.ceil(case.limits.ticks(lag_m / speed)) + _filter_ticks(case)
        return Expected(("skew", "following_error", "encoder_stuck"), least, most)
    if speed**2 < -2.0 * slowest * high:
        raise ValueError(f"{case.fault}: the loop may hold the other end back; move faster")
    lasts_s = _time_s(high, speed, slowest)
    if speed * lasts_s - 0.5 * high > _allowed_m(case, speed):
        raise ValueError(f"{case.fault}: the following error trips as early")
    return Expected(("skew",), least, math.ceil(case.limits.ticks(lasts_s)) + 1)


def end_dead(case: Setting) -> Expected:
    """Expect that an end without a motor can not follow: the skew or the following error tells.

    Nothing but the other end, the guideways and the skew move the dead end. With y the mean and s
    the skew: (own + cross) y'' + (own - cross)/2 s'' = -friction - k s - c s'. Integrated twice,
    with both errors at their limits, it tells when the reference has gone further than the end can
    have, whatever the loop does with the motor that is left.
    """
    beam, limits, speed = _beam(case), case.limits, abs(case.speed_m_s)
    pulled = beam.own + beam.cross
    skew_m = (1.0 + ERROR_BEFORE) * beam.limit_m
    friction = beam.own_end.friction_v(0.5 * speed) - abs(beam.own_end.offset)
    start = case.reference(0)
    for k in range(1, math.ceil(limits.ticks(LONGEST_S))):
        t = k * limits.period_s
        gone_m = case.direction * (case.reference(k) - start) - speed * t
        faster = abs(case.reference(k + 1) - case.reference(k)) / limits.period_s
        error_m = (1.0 + ERROR_BEFORE) * _allowed_m(case, faster)
        left = pulled * error_m + 0.5 * abs(beam.own - beam.cross) * skew_m
        left += 0.5 * beam.stiffness * skew_m * t * t + beam.damping * skew_m * t
        if pulled * gone_m + 0.5 * friction * t * t > left:
            most = k + _filter_ticks(case)
            return Expected(("skew", "following_error"), _dead_least(case, beam), most)
    raise ValueError(f"{case.fault}: the other motor may do without; fault an axis that speeds up")


def _dead_least(case: Setting, beam: Beam) -> int:
    """Return the earliest tick: the motor that is left gives its full force from the start on."""
    limits, full = case.limits, beam.full_v * beam.other_ratio
    drag = beam.own_end.friction_v(limits.top_speed_m_s) + abs(beam.own_end.offset)
    drag += beam.other_end.friction_v(limits.top_speed_m_s) + abs(beam.other_end.offset)
    apart = abs(beam.own_m_s2(drag, -full) - beam.other_m_s2(drag, -full))
    skew = limits.ticks(math.sqrt(2.0 * (1.0 - ERROR_BEFORE) * beam.limit_m / apart))
    mean = 0.5 * abs(beam.own_m_s2(drag, full) + beam.other_m_s2(drag, full))
    changes = [case.reference(k + 1) - case.reference(k) for k in range(math.ceil(skew) + 1)]
    mean += max(abs(b - a) for a, b in itertools.pairwise(changes)) / limits.period_s**2
    allowed_m = (1.0 - ERROR_BEFORE) * limits.error_minimum_m
    lag = limits.ticks(math.sqrt(2.0 * allowed_m / mean) + limits.error_filter_s)
    return math.floor(min(skew, lag))


def end_pushed(case: Setting) -> Expected:
    """Expect the skew guard: a push that the two motors together cannot balance.

    At most the push alone turns the beam; at least what the motors leave of it: the skew loop has
    its part of the voltage at both ends, and the law the rest.
    """
    beam, limits = _beam(case), case.limits
    push = abs(case.drawn["push_v"])
    speed = 2.0 * limits.top_speed_m_s
    drag_own = beam.own_end.friction_v(speed) + abs(beam.own_end.offset)
    drag_other = beam.other_end.friction_v(speed) + abs(beam.other_end.offset)
    pull = beam.stiffness * (1.0 + ERROR_BEFORE) * beam.limit_m

    def apart(own_v: float, other_v: float) -> float:
        return beam.own_m_s2(own_v, other_v) - beam.other_m_s2(own_v, other_v)

    # Whatever the law does, and for the skew loop from nothing to all that it may.
    motors = [
        apart(-beam.own_ratio * (mean + skew), -beam.other_ratio * (mean - skew))
        for skew in (0.0, beam.skew_v)
        for mean in (skew - beam.full_v, beam.full_v - skew)
    ]
    drag = abs(apart(drag_own, 0.0)) + abs(apart(0.0, drag_other))
    slowest = apart(push - pull, pull) + min(motors) - drag
    fastest = apart(push, 0.0) + max(0.0, *motors) + drag
    if slowest <= 0.0:
        raise ValueError(f"{case.fault}: the motors may hold it; push harder")
    low, high = (1.0 - ERROR_BEFORE) * beam.limit_m, (1.0 + ERROR_BEFORE) * beam.limit_m
    least = math.floor(limits.ticks(math.sqrt(2.0 * low / fastest)))
    most = math.ceil(limits.ticks(math.sqrt(2.0 * high / slowest))) + 1
    if most > case.drawn["push_ticks"]:
        raise ValueError(f"{case.fault}: the push ends before the skew has come to its limit")
    return Expected(("skew",), least, most)


def end_switch(case: Setting) -> Expected:
    """Expect that homing tells it, as far beyond the other end's switch as a square beam may be."""
    beam = _beam(case)
    way_s = (beam.to_switch_m + beam.apart_m) / case.drawn["search_m_s"]
    least, most = case.limits.ticks(way_s), case.limits.ticks(way_s + RAMP_UP_S)
    return Expected(("not_square",), math.floor(least) - 1, math.ceil(most) + 1)


def _beam(case: Setting) -> Beam:
    if case.beam is None:
        raise ValueError(f"{case.fault}: the axis has one motor")
    return case.beam


def _allowed_m(case: Setting, speed_m_s: float) -> float:
    """Return the following error that is allowed at a speed."""
    limits = case.limits
    return limits.error_minimum_m + limits.error_per_velocity_s * speed_m_s


def _filter_ticks(case: Setting) -> int:
    """Return how long the following error has to last, and two ticks to see and tell it."""
    return round(case.limits.ticks(case.limits.error_filter_s)) + 2


def _time_s(way_m: float, speed_m_s: float, acceleration_m_s2: float) -> float:
    """Return how long a way takes from a speed on; the way has to be reached."""
    if abs(acceleration_m_s2) < 1e-9:
        return way_m / speed_m_s
    root = math.sqrt(speed_m_s**2 + 2.0 * acceleration_m_s2 * way_m)
    return (root - speed_m_s) / acceleration_m_s2


def _others_accelerations(beam: Beam, speed_m_s: float) -> tuple[float, float]:
    """Return the largest and the smallest acceleration of the end whose count is still true.

    The mean's command is between nothing and what the skew loop leaves of the voltage; the skew
    loop's takes from the one end what it gives the other, and may be nothing or all it has.
    """
    drag_own = beam.own_end.friction_v(2.0 * speed_m_s) + abs(beam.own_end.offset)
    drag_other = beam.other_end.friction_v(2.0 * speed_m_s) + abs(beam.other_end.offset)
    pull = beam.stiffness * beam.limit_m
    driven = [
        beam.other_m_s2(beam.own_ratio * (mean + skew), beam.other_ratio * (mean - skew))
        for skew in (0.0, beam.skew_v)
        for mean in (0.0, beam.full_v - skew)
    ]
    fastest = max(driven) + beam.other_m_s2(-drag_own - pull, pull)
    slowest = min(driven) + beam.other_m_s2(pull, -drag_other - pull)
    return fastest, slowest


END_EXPECTED: Mapping[str, Callable[[Setting], Expected]] = {
    "end_encoder_lost": at_once("encoder_lost"),
    "end_amplifier_fault": at_once("amplifier"),
    "end_silence": no_new_sample,
    "end_encoder_jump": at_once("encoder_jump"),
    "end_encoder_stuck": end_stuck,
    "end_limit_switch": limit_switch,
    "end_dead_output": end_dead,
    "end_push": end_pushed,
    "end_home_switch": end_switch,
}
"""Every fault of one end."""

END_REFUSED_WHILE = {
    "end_encoder_lost": "STILL_FAULTY",
    "end_amplifier_fault": "STILL_FAULTY",
    "end_silence": "STILL_FAULTY",
}
"""The answer to a reset while one end's device reports its fault, or brings no sample."""
