"""Guards that could never trip, or always would: each rule says so with its arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator

from motorctl.config.axis_keys import Encoder, Limits
from motorctl.config.count_limits import too_fast_m_s
from motorctl.config.guard_keys import (
    NO_QUICK_STOP,
    OVERSPEED_COUNTS,
    OVERSPEED_RATIO,
    STALLED_S,
    Guards,
    Saturation,
)
from motorctl.config.noise_rules import COUNTS_AT_REST, check_noise
from motorctl.config.validation import Finding

LONGEST_SATURATION_S = 60.0
"""That a command may stand at its limit [s]. Longer is no guard: an axis that is free crosses any
travel in it, and the motor of one that is blocked burns. Shorter forbids what a slow machine may
want. Chosen by hand."""
HEATING_CONSTANTS = 3.0
"""Time constants within which the full command has to trip the model of the motor's heat. By then
a motor is within 5 % of as warm as that command ever makes it, so that a model that trips later
warns of nothing. Larger accepts those; smaller refuses motors that carry nearly all of the full
command, 97.47 % of it with this. Chosen by hand."""


def check_guards(
    guards: Guards, limits: Limits, encoder: Encoder, rate_hz: float, fullest_m_s2: float
) -> Iterator[Finding]:
    """Check the guards of an axis against its limits and its encoder.

    fullest_m_s2 is what the full voltage can accelerate.
    """
    yield from _check_stuck(guards, limits, encoder)
    if guards.encoder_noise:
        yield from check_noise(guards.encoder_noise, limits, encoder, 1.0 / rate_hz, fullest_m_s2)
    yield from _check_command(guards, limits, 1.0 / rate_hz)
    yield from _check_frozen(guards, 1.0 / rate_hz)


def check_reactions(guards: Guards) -> Iterator[Finding]:
    """Check that no guard asks for a ramp where there is nothing to follow it with."""
    for name, why in NO_QUICK_STOP.items():
        guard = getattr(guards, name)
        if guard is not None and guard.reaction == "quick_stop":
            yield ("guards", name, "reaction"), f"found 'quick_stop', should be disable: {why}"


def check_ramps(limits: Limits, least_inertia_v_s2_m: float) -> Iterator[Finding]:
    """Check that the motor can follow the hardest braking at all; the stop ramp is no harder.

    With its full voltage, and once more as much for what brakes it besides: more friction or load
    could not be moved. A ramp beyond is a jump of the reference, which trips instead of braking.
    """
    if not least_inertia_v_s2_m > 0.0:
        return
    full, hardest = limits.max_voltage_v, limits.max_acceleration_m_s2
    most = 2.0 * full / least_inertia_v_s2_m
    if hardest > most:
        yield (
            ("limits", "max_acceleration_m_s2"),
            f"found {hardest:g}, braking with it can never be followed: twice max_voltage_v "
            f"{full:g} V at the lower bound of the inertia, {least_inertia_v_s2_m:g} V*s^2/m, give "
            f"no more than {most:.3g} m/s^2; should be at most that, and the stop ramp, too",
        )


def check_overspeed(
    limits: Limits, encoder: Encoder, rate_hz: float, least_inertia_v_s2_m: float
) -> Iterator[Finding]:
    """Check that the axis can become so fast on its travel that its speed trips it.

    With its full voltage, and once more as much for what pulls it: more could not be held.
    """
    low, high = limits.travel_m
    if not (low < high and least_inertia_v_s2_m > 0.0):
        return
    full = limits.max_voltage_v
    trips_m_s = too_fast_m_s(limits.max_velocity_m_s, encoder.resolution_m, 1.0 / rate_hz)
    fastest = math.sqrt(2.0 * (2.0 * full / least_inertia_v_s2_m) * (high - low))
    if trips_m_s >= fastest:
        yield (
            ("limits", "max_velocity_m_s"),
            f"found {limits.max_velocity_m_s:g}, guards.overspeed can never trip: it would at "
            f"{OVERSPEED_RATIO:g} times as much and {OVERSPEED_COUNTS} counts a period, "
            f"{trips_m_s:.4g} m/s, and twice max_voltage_v {full:g} V bring the axis to no more "
            f"than {fastest:.3g} m/s within its travel of {high - low:g} m; should be less",
        )


def _check_frozen(guards: Guards, period_s: float) -> Iterator[Finding]:
    frozen_s, where = guards.host_frozen.time_s, ("guards", "host_frozen", "time_s")
    if frozen_s is None:
        return
    if frozen_s < 2.0 * period_s:
        message = f"found {frozen_s:g}, should be at least two periods of the axis, "
        yield where, f"{message}{2.0 * period_s:g} s"
    elif frozen_s >= STALLED_S:
        yield (
            where,
            f"found {frozen_s:g}, can never trip: a loop that has not ticked for {STALLED_S:g} s "
            "is ended, and its outputs disabled; should be less",
        )


def _check_stuck(guards: Guards, limits: Limits, encoder: Encoder) -> Iterator[Finding]:
    if not guards.encoder_stuck or guards.encoder_stuck.distance_m is None:
        return
    distance, error = guards.encoder_stuck.distance_m, limits.following_error
    where = ("guards", "encoder_stuck", "distance_m")
    least = COUNTS_AT_REST * encoder.resolution_m
    if distance <= least:
        message = f"found {distance:g}, should be above {COUNTS_AT_REST} encoder counts, {least:g}"
        yield where, f"{message} m: a slow motion would always trip it"
    fastest = limits.max_velocity_m_s
    most = error.minimum_m + (error.per_velocity_s + error.filter_time_s) * fastest
    if distance >= most:
        yield (
            where,
            f"found {distance:g}, can never trip: the following error does before, at "
            f"{error.minimum_m:g} m + ({error.per_velocity_s:g} s + {error.filter_time_s:g} s) x "
            f"{fastest:g} m/s = {most:g} m; should be less",
        )
        return
    travel = limits.travel_m[1] - limits.travel_m[0]
    if distance >= 0.5 * travel > 0.0:
        yield (
            where,
            f"found {distance:g}, can never trip from the middle of the travel of {travel:g} m: "
            f"there the reference goes no further than half of it, {0.5 * travel:g} m, either way; "
            "should be less",
        )


def _check_command(guards: Guards, limits: Limits, period_s: float) -> Iterator[Finding]:
    full, saturation, thermal = limits.max_voltage_v, guards.saturation, guards.thermal
    if saturation and saturation.time_s < 2.0 * period_s:
        message = f"found {saturation.time_s:g}, should be at least two periods of the axis, "
        yield ("guards", "saturation", "time_s"), f"{message}{2.0 * period_s:g} s"
    elif saturation and saturation.time_s > LONGEST_SATURATION_S:
        yield (
            ("guards", "saturation", "time_s"),
            f"found {saturation.time_s:g}, can hardly ever trip: no axis in order needs its full "
            f"command for so long, and a blocked motor does not last; should be at most "
            f"{LONGEST_SATURATION_S:g} s; saturation: null switches the guard off",
        )
    if not thermal:
        return
    continuous = thermal.continuous_voltage_v
    if continuous >= full:
        message = f"found {continuous:g}, can never trip: no command exceeds max_voltage_v "
        yield (
            ("guards", "thermal", "continuous_voltage_v"),
            f"{message}{full:g} V; should be less, or the guard be removed",
        )
        return
    warm_s = -thermal.time_constant_s * math.log1p(-((continuous / full) ** 2))
    if warm_s > HEATING_CONSTANTS * thermal.time_constant_s:
        most = full * math.sqrt(-math.expm1(-HEATING_CONSTANTS))
        yield (
            ("guards", "thermal", "continuous_voltage_v"),
            f"found {continuous:g}, can hardly ever trip: max_voltage_v {full:g} V would have to "
            f"stand for {warm_s:.3g} s, {warm_s / thermal.time_constant_s:.2g} time constants; "
            f"should be at most {math.floor(1e4 * most / full) * full / 1e4:g} V, which trips "
            f"within {HEATING_CONSTANTS:g}, or the guard be removed",
        )
        return
    # A default that comes too late is nobody's mistake; what a log holds says it, too.
    if saturation and saturation != Saturation() and saturation.time_s >= warm_s:
        yield (
            ("guards", "saturation", "time_s"),
            f"found {saturation.time_s:g}, comes too late where the command stands still: "
            f"guards.thermal trips after {warm_s:.3g} s at {full:g} V; should be less",
        )
