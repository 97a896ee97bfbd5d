"""Guards that could never trip, or always would: each rule says so with its arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from motorctl.config.axis_keys import Encoder, Limits
from motorctl.config.guard_keys import (
    JUMP_COUNTS,
    JUMP_SPEED_RATIO,
    NO_QUICK_STOP,
    OVERSPEED_RATIO,
    STALLED_S,
    Guards,
    Saturation,
    Thermal,
)
from motorctl.config.validation import Finding
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.motion import AxisLimits, Program, RequiredVoltage

COUNTS_AT_REST = 2
"""An encoder between two counts flickers by so many in its second difference."""
LONGEST_FILTER_S = 60.0
"""Of the noise's mean square [s]. Longer, and noise of twice its limit has to last for more than a
quarter of it, longer than axes rest; shorter forbids limits near the noise of an axis in order.
Chosen by hand."""
LONGEST_SATURATION_S = 60.0
"""That a command may stand at its limit [s]. Longer is no guard: an axis that is free crosses any
travel in it, and the motor of one that is blocked burns. Shorter forbids what a slow machine may
want. Chosen by hand."""
HEATING_CONSTANTS = 3.0
"""Time constants within which the full command has to trip the model of the motor's heat. By then
a motor is within 5 % of as warm as that command ever makes it, so that a model that trips later
warns of nothing. Larger accepts those; smaller refuses motors that carry nearly all of the full
command, 97.47 % of it with this. Chosen by hand."""
SLOW_RATIO = 0.1
"""Of the top speed: at such a speed hardly more than friction has to be overcome. Larger adds what
the speed costs, smaller than the friction's turn-over leaves friction out. Chosen by hand."""
PLACES = 201
"""On the travel at which slow motion is looked at. Fewer miss where cogging pulls most, more only
take longer. Chosen by hand."""
HEAT_SAMPLES = 4001
"""Instants of one cycle of a program at which its command is computed."""


def check_guards(
    guards: Guards, limits: Limits, encoder: Encoder, rate_hz: float, fullest_m_s2: float
) -> Iterator[Finding]:
    """Check the guards of an axis against its limits and its encoder.

    fullest_m_s2 is what the full voltage can accelerate.
    """
    yield from _check_stuck(guards, limits, encoder)
    yield from _check_noise(guards, limits, encoder, 1.0 / rate_hz, fullest_m_s2)
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


def check_overspeed(limits: Limits, least_inertia_v_s2_m: float) -> Iterator[Finding]:
    """Check that the axis can become so fast on its travel that its speed trips it.

    With its full voltage, and once more as much for what pulls it: more could not be held.
    """
    low, high = limits.travel_m
    if not (low < high and least_inertia_v_s2_m > 0.0):
        return
    full, trips_m_s = limits.max_voltage_v, OVERSPEED_RATIO * limits.max_velocity_m_s
    fastest = math.sqrt(2.0 * (2.0 * full / least_inertia_v_s2_m) * (high - low))
    if trips_m_s >= fastest:
        yield (
            ("limits", "max_velocity_m_s"),
            f"found {limits.max_velocity_m_s:g}, guards.overspeed can never trip: it would at "
            f"{OVERSPEED_RATIO:g} times as much, {trips_m_s:g} m/s, and twice max_voltage_v "
            f"{full:g} V bring the axis to no more than {fastest:.3g} m/s within its travel of "
            f"{high - low:g} m; should be less",
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


def _check_noise(
    guards: Guards, limits: Limits, encoder: Encoder, period_s: float, fullest_m_s2: float
) -> Iterator[Finding]:
    noise = guards.encoder_noise
    if not noise:
        return
    where = ("guards", "encoder_noise", "rms_m")
    flicker, motion = COUNTS_AT_REST * encoder.resolution_m, fullest_m_s2 * period_s**2
    if noise.rms_m <= flicker + motion:
        yield (
            where,
            f"found {noise.rms_m:g}, should be above {COUNTS_AT_REST} encoder counts and what "
            f"{fullest_m_s2:g} m/s^2 move in a period of {period_s:g} s: {flicker + motion:.3g} m; "
            "below, an axis in order would trip it",
        )
    reach = JUMP_SPEED_RATIO * limits.max_velocity_m_s * period_s
    largest = 2.0 * (reach + JUMP_COUNTS * encoder.resolution_m)
    if noise.rms_m >= largest:
        message = f"found {noise.rms_m:g}, can never trip: steps that differ by {largest:.3g} m"
        yield where, f"{message} are a jump of the encoder before; should be less"
    where = ("guards", "encoder_noise", "filter_time_s")
    if noise.filter_time_s < period_s:
        message = f"found {noise.filter_time_s:g}, should be at least a period, {period_s:g} s"
        yield where, message
    elif noise.filter_time_s > LONGEST_FILTER_S:
        lasts_s = noise.filter_time_s * math.log(4.0 / 3.0)
        yield (
            where,
            f"found {noise.filter_time_s:g}, can hardly ever trip: noise of twice rms_m would have "
            f"to last for {lasts_s:.3g} s of rest; should be at most {LONGEST_FILTER_S:g} s",
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
            f"found {saturation.time_s:g}, can never trip: guards.thermal does so after "
            f"{warm_s:.3g} s at {full:g} V; should be less",
        )


def check_heat(
    document: Document,
    programs: Mapping[str, Program],
    thermals: Mapping[str, Thermal],
    limits: Mapping[str, AxisLimits],
    required_voltage: Mapping[str, RequiredVoltage],
) -> list[Problem]:
    """Check that neither slow motion nor the program that an axis follows always trips its model.

    The command is the one that the model needs at theta(0); all cycles of the program count.
    """
    problems = []
    for axis, thermal in thermals.items():
        need, own = required_voltage.get(axis), limits.get(axis)
        if need is None or own is None:
            continue
        followed = document.at(("axes", axis, "program"))
        program = programs.get(followed) if isinstance(followed, str) else None
        told = _slow_heat(thermal, own, need)
        if program is not None and axis in program.axes:
            told = _program_heat(thermal, f"'{followed}'", program, axis, need) or told
        if told:
            where = ("axes", axis, "guards", "thermal", "continuous_voltage_v")
            message = f"found {thermal.continuous_voltage_v:g}, would always trip: {told}"
            problems.append(document.problem(where, message))
    return problems


def _program_heat(
    thermal: Thermal, name: str, program: Program, axis: str, need: RequiredVoltage
) -> str | None:
    trajectory = program.trajectories()[axis]
    t = np.linspace(0.0, trajectory.duration_s / program.cycles, HEAT_SAMPLES)
    mean_v2 = float(np.mean(need(*trajectory.sample(t)) ** 2))
    warmed = -math.expm1(-trajectory.duration_s / thermal.time_constant_s)
    rms_v = math.sqrt(mean_v2 * warmed)
    if rms_v <= thermal.continuous_voltage_v:
        return None
    return f"program {name} needs {rms_v:.3g} V rms; make the program slower, or raise it"


def _slow_heat(thermal: Thermal, limits: AxisLimits, need: RequiredVoltage) -> str | None:
    """Look at slow motion back and forth, with nothing to accelerate."""
    places, speed = np.linspace(*limits.travel_m, PLACES), SLOW_RATIO * limits.max_velocity_m_s
    there, back = (need(places, np.full(PLACES, v), np.zeros(PLACES)) for v in (speed, -speed))
    rms_v = math.sqrt(float(np.mean(there**2 + back**2)) / 2.0)
    if rms_v <= thermal.continuous_voltage_v:
        return None
    return (
        f"slow motion back and forth, at {speed:g} m/s, needs {rms_v:.3g} V rms for friction and "
        "load; should be more"
    )
