"""What each fault has to be detected by, and within which ticks: one table, made by arithmetic.

It knows the configuration's numbers and the simulated carriage's mass and friction, and nothing of
the loop: no guard's formula is imported here. Ticks are counted from the first one whose read is
wrong, or after whose write a wrong force acts: 0 is that tick itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from motorctl_benchmarks.safety.end_expectations import END_EXPECTED, END_REFUSED_WHILE
from motorctl_benchmarks.safety.expected import (
    ERROR_BEFORE,
    NOTHING,
    RAMP_UP_S,
    Expected,
    at_once,
    limit_switch,
    no_new_sample,
    nothing,
)
from motorctl_benchmarks.safety.setting import Setting

SILENT_S = 0.5
STANDARD_DEVIATIONS = 4.0
"""That a random amount may be off."""
OVERSPEED_SAMPLES = 5
OVERSPEED_RATIO = 1.2
BUCKET = 10


def encoder_stuck(case: Setting) -> Expected:
    """The reference has moved by the distance since the last tick with a count that was true."""
    limits, start = case.limits, case.reference(-1)
    moved = 0
    while abs(case.reference(moved) - start) <= limits.error_minimum_m:
        moved += 1
        if moved > 10 / limits.period_s:
            return NOTHING
    # The last change may have been smaller than two counts, and a sample may be doubted once.
    speed = max(abs(case.speed_m_s), 1e-3)
    early = math.ceil(2.0 * limits.count_m / (speed * limits.period_s)) + 1
    return Expected(("encoder_stuck",), moved - early, moved + (2 if limits.predicts else 1))


def encoder_noise(case: Setting) -> Expected:
    """A mean square that starts at 0 comes to 1/q of its end after -ln(1 - 1/q) time constants."""
    q, ticks = case.drawn["times_square"], case.drawn["filter_ticks"]
    least = -math.log1p(-1.0 / (q * (1.0 + _spread(q, ticks))))
    most = -math.log1p(-1.0 / (q * (1.0 - _spread(q, ticks))))
    return Expected(("encoder_noise",), math.floor(least * ticks), math.ceil(most * ticks))


def _spread(q: float, ticks: float) -> float:
    """Return by how much the mean square may be off when it has come to its limit, as a part.

    Squares of second differences of white noise are correlated by 4/9 and 1/36, so that a mean of n
    of them has a relative variance of 2 (1 + 2 (4/9 + 1/36)) / n.
    """
    samples = -math.log1p(-1.0 / q) * ticks
    variance = 2.0 * (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)) / samples
    return STANDARD_DEVIATIONS * math.sqrt(variance)


def dead_output(case: Setting) -> Expected:
    """Friction alone brakes, while the reference goes on."""
    plant, speed = case.plant, case.speed_m_s
    fastest = (plant.friction_v(speed) + abs(plant.offset)) / plant.inertia
    slowest = (plant.friction_v(0.5 * speed) - abs(plant.offset)) / plant.inertia
    return _following_error(case, fastest, slowest)


def reversed_motor(case: Setting) -> Expected:
    """What held against friction now pushes with it, at least; at most the full voltage does."""
    plant, speed = case.plant, case.speed_m_s
    fastest = (plant.full_thrust_v + plant.friction_v(speed) + 1.0) / plant.inertia
    slowest = 2.0 * (plant.friction_v(0.5 * speed) - abs(plant.offset)) / plant.inertia
    return _following_error(case, fastest, slowest)


def full_output(case: Setting) -> Expected:
    """The full thrust, with friction or against it."""
    plant = case.plant
    friction = plant.friction_v(2.0 * case.limits.top_speed_m_s) + abs(plant.offset)
    fastest = (plant.full_thrust_v + friction) / plant.inertia
    slowest = (plant.full_thrust_v - friction) / plant.inertia
    return _following_error(case, fastest, slowest)


def shove(case: Setting) -> Expected:
    """The push alone at most; less the full thrust against it at least."""
    fastest, slowest = _pushed(case)
    if case.speed_m_s * case.drawn["push_m_s2"] >= 0.0:
        beyond = OVERSPEED_RATIO * case.limits.top_speed_m_s - abs(case.speed_m_s)
        for pushed in (fastest, slowest):  # whichever it is, it is so for both guards
            too_fast = case.limits.ticks(beyond / pushed) + OVERSPEED_SAMPLES
            if too_fast <= _following_error(case, pushed, pushed).most:
                raise ValueError(f"{case.fault}: the speed trips as early; push less")
    return _following_error(case, fastest, slowest)


def overspeed(case: Setting) -> Expected:
    """Five samples beyond 1.2 times the top speed, and before the following error trips."""
    fastest, slowest = _pushed(case)
    limits = case.limits
    beyond = OVERSPEED_RATIO * limits.top_speed_m_s - abs(case.speed_m_s)
    noise = 2.0 * limits.count_m / limits.period_s
    least = math.floor(limits.ticks(beyond / fastest)) + OVERSPEED_SAMPLES
    most = math.ceil(limits.ticks((beyond + noise) / slowest)) + OVERSPEED_SAMPLES + 2
    if _following_error(case, fastest, slowest).least <= most:
        raise ValueError(f"{case.fault}: the following error trips as early; push harder")
    return Expected(("overspeed",), least, most)


def soft_limit(case: Setting) -> Expected:
    """Out of the travel by the following error at rest, before that error's filter has passed."""
    fastest, slowest = _pushed(case)
    limits, place = case.limits, case.reference(0)
    side = 1 if case.drawn["push_m_s2"] > 0.0 else 0
    distance = abs(limits.travel_m[side] - place) + limits.error_minimum_m
    least = math.floor(limits.ticks(math.sqrt(2.0 * distance / fastest)))
    most = math.ceil(limits.ticks(math.sqrt(2.0 * distance / slowest))) + 1
    for pushed in (fastest, slowest):  # whichever it is, it is so for both guards
        out = limits.ticks(math.sqrt(2.0 * distance / pushed))
        if _following_error(case, pushed, pushed).least <= math.ceil(out):
            raise ValueError(f"{case.fault}: the following error trips as early")
    return Expected(("soft_limit",), least, most)


def saturation(case: Setting) -> Expected:
    """The time at the limit, from when three time constants of the loop's two poles are over."""
    limits = case.limits
    onset_s = 3.0 / limits.k1_1_s + 3.0 * case.plant.inertia / limits.ks_v_s_m
    least = round(limits.ticks(case.drawn["time_s"]))
    return Expected(("saturation",), least, least + math.ceil(limits.ticks(onset_s)) + 2)


MEETS_PUSH = 1.08
"""The command (rms) until the winding is too warm, over the one that holds: the law gives more
while it brings the carriage back. By hand; of 30 draws the one that took most of it needed 1.06."""


def thermal(case: Setting) -> Expected:
    """A winding with one time constant, under the command that holds against the push."""
    limits, plant = case.limits, case.plant
    limit_v, constant_s = case.drawn["continuous_v"], case.drawn["constant_s"]
    force = abs(case.drawn["push_m_s2"]) * plant.inertia
    settled_s = 3.0 / limits.k1_1_s + 3.0 * plant.inertia / limits.ks_v_s_m

    def warm_s(command_v: float) -> float:
        return -constant_s * math.log1p(-((limit_v / command_v) ** 2))

    held_v = _command_for(case, force)
    least = warm_s(MEETS_PUSH * held_v + abs(plant.offset))
    most = warm_s(0.97 * held_v - abs(plant.offset)) + settled_s
    return Expected(
        ("thermal",), math.floor(limits.ticks(least)), math.ceil(limits.ticks(most)) + 1
    )


def obstacle(case: Setting) -> Expected:
    """A count that stands looks like a stuck encoder; one that trembles on is behind its reference.

    Which of the two comes first depends on how the rubber rings, so the table allows both.
    """
    limits, speed = case.limits, abs(case.speed_m_s)
    allowed = limits.error_minimum_m + limits.error_per_velocity_s * speed
    give_m = 1.2 * speed / case.drawn["rubber_rad_s"]
    filtered = round(limits.ticks(limits.error_filter_s))
    least = math.floor(limits.ticks(limits.error_minimum_m / speed)) - 2
    most = math.ceil(limits.ticks((1.1 * allowed + give_m) / speed)) + filtered + 3
    return Expected(("following_error", "encoder_stuck"), least, most)


def late_ticks(_case: Setting) -> Expected:
    """The bucket holds ten: the tenth in a row fills it."""
    return Expected(("overrun",), BUCKET - 1, BUCKET - 1)


def supervisor_lost(case: Setting) -> Expected:
    """More than half a second without a sign of life."""
    silent = round(case.limits.ticks(SILENT_S))
    return Expected(("supervisor_lost",), silent, silent)


def no_home_switch(case: Setting) -> Expected:
    """The limit switch behind it, at the searching speed."""
    way_s = case.drawn["to_limit_m"] / case.drawn["search_m_s"]
    least, most = case.limits.ticks(way_s), case.limits.ticks(way_s + RAMP_UP_S)
    return Expected(("homing_failed",), math.floor(least) - 1, math.ceil(most))


def _following_error(case: Setting, fastest_m_s2: float, slowest_m_s2: float) -> Expected:
    """Expect the following error of an axis that leaves its reference with such accelerations."""
    limits = case.limits
    allowed = limits.error_minimum_m + limits.error_per_velocity_s * abs(case.speed_m_s)
    low, high = (1.0 - ERROR_BEFORE) * allowed, (1.0 + ERROR_BEFORE) * allowed
    filtered = round(limits.ticks(limits.error_filter_s))
    least = math.floor(limits.ticks(math.sqrt(2.0 * low / fastest_m_s2))) + filtered
    most = math.floor(limits.ticks(math.sqrt(2.0 * high / slowest_m_s2))) + filtered + 2
    return Expected(("following_error",), least, most + (1 if limits.predicts else 0))


def _pushed(case: Setting) -> tuple[float, float]:
    """Return the largest and the smallest acceleration of an axis that is pushed."""
    plant = case.plant
    push = abs(case.drawn["push_m_s2"])
    friction = plant.friction_v(OVERSPEED_RATIO * case.limits.top_speed_m_s) + abs(plant.offset)
    return push + friction / plant.inertia, push - (plant.full_thrust_v + friction) / plant.inertia


def _command_for(case: Setting, force_v: float) -> float:
    """Return the command whose thrust is a force, by bisection."""
    plant, low, high = case.plant, 0.0, 10.0
    for _ in range(60):
        u = 0.5 * (low + high)
        if u + plant.quadratic * u * u + plant.cubic * u**3 < force_v:
            low = u
        else:
            high = u
    return low


EXPECTED: Mapping[str, Callable[[Setting], Expected]] = {
    "encoder_lost": at_once("encoder_lost"),
    "amplifier_fault": at_once("amplifier"),
    "estop": at_once("estop"),
    "device_lost": at_once("communication"),
    "encoder_blinks": at_once("encoder_lost"),
    "silence": no_new_sample,
    "short_silence": nothing,
    "encoder_jump": at_once("encoder_jump"),
    "encoder_glitch": at_once("encoder_jump"),
    "encoder_stuck": encoder_stuck,
    "encoder_noise": encoder_noise,
    "limit_switch": limit_switch,
    "limit_switch_behind": nothing,
    "limit_switch_at_rest": nothing,
    "dead_output": dead_output,
    "reversed_motor": reversed_motor,
    "full_output": full_output,
    "shove": shove,
    "knock": nothing,
    "push_too_fast": overspeed,
    "push_out_of_travel": soft_limit,
    "overload": saturation,
    "overheating": thermal,
    "obstacle": obstacle,
    "host_pause": at_once("host_frozen"),
    "short_pause": nothing,
    "late_ticks": late_ticks,
    "late_now_and_then": nothing,
    "supervisor_dead": supervisor_lost,
    "supervisor_slow": nothing,
    "estop_command": at_once("estop"),
    "learned_nan": at_once("not_a_number"),
    "law_nan": at_once("not_a_number"),
    "no_home_switch": no_home_switch,
    **END_EXPECTED,
}
"""Every fault of the campaign; an import rule keeps them apart from the loop."""

FIRST_CAUSE = {"reaction": "overrun", "fault": "estop"}
"""States that a fault finds after another one: that one's cause stays."""
ALL_AXES = ("host_pause", "late_ticks", "supervisor_dead", "estop_command")
"""Faults that no axis is spared."""
QUICK_BY_DEFAULT = ("late_ticks", "supervisor_dead", "overheating")
"""The other guards disable, unless they are told to ramp down."""
REFUSED_WHILE = {
    "encoder_lost": "STILL_FAULTY",
    "amplifier_fault": "STILL_FAULTY",
    "estop": "STILL_FAULTY",
    "device_lost": "STILL_FAULTY",
    "silence": "STILL_FAULTY",
    "overheating": "CAUSE_LASTS",
    "push_too_fast": "CAUSE_LASTS",
    "learned_nan": "CAUSE_LASTS",
    **END_REFUSED_WHILE,
}
"""The answer to a reset, and to a start of an axis that is off, while the cause is there. Others
are gone once the axis is disabled, or nobody can see them then."""
