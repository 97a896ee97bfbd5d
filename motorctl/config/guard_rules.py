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
    Guards,
    Thermal,
)
from motorctl.config.validation import Finding
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.motion import Program, RequiredVoltage

COUNTS_AT_REST = 2
"""An encoder between two counts flickers by so many in its second difference."""
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
    frozen_s = guards.host_frozen.time_s
    if frozen_s is not None and frozen_s < 2.0 / rate_hz:
        message = f"found {frozen_s:g}, should be at least two periods of the axis, "
        yield ("guards", "host_frozen", "time_s"), f"{message}{2.0 / rate_hz:g} s"


def check_reactions(guards: Guards) -> Iterator[Finding]:
    """Check that no guard asks for a ramp where there is nothing to follow it with."""
    for name, why in NO_QUICK_STOP.items():
        guard = getattr(guards, name)
        if guard is not None and guard.reaction == "quick_stop":
            yield ("guards", name, "reaction"), f"found 'quick_stop', should be disable: {why}"


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
    if noise.filter_time_s < period_s:
        message = f"found {noise.filter_time_s:g}, should be at least a period, {period_s:g} s"
        yield ("guards", "encoder_noise", "filter_time_s"), message


def _check_command(guards: Guards, limits: Limits, period_s: float) -> Iterator[Finding]:
    full, saturation, thermal = limits.max_voltage_v, guards.saturation, guards.thermal
    if saturation and saturation.time_s < 2.0 * period_s:
        message = f"found {saturation.time_s:g}, should be at least two periods of the axis, "
        yield ("guards", "saturation", "time_s"), f"{message}{2.0 * period_s:g} s"
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
    # A default that comes too late is nobody's mistake.
    if saturation and "saturation" in guards.model_fields_set and saturation.time_s >= warm_s:
        yield (
            ("guards", "saturation", "time_s"),
            f"found {saturation.time_s:g}, can never trip: guards.thermal does so after "
            f"{warm_s:.3g} s at {full:g} V; should be less",
        )


def check_heat(
    document: Document,
    programs: Mapping[str, Program],
    thermals: Mapping[str, Thermal],
    required_voltage: Mapping[str, RequiredVoltage],
) -> list[Problem]:
    """Check that the program that an axis follows does not always trip the axis' thermal guard.

    The command is the one that the model needs at theta(0); all cycles of the program count.
    """
    problems = []
    for axis, thermal in thermals.items():
        followed = document.at(("axes", axis, "program"))
        program = programs.get(followed) if isinstance(followed, str) else None
        need = required_voltage.get(axis)
        if program is None or need is None or axis not in program.axes:
            continue
        trajectory = program.trajectories()[axis]
        t = np.linspace(0.0, trajectory.duration_s / program.cycles, HEAT_SAMPLES)
        mean_v2 = float(np.mean(need(*trajectory.sample(t)) ** 2))
        warmed = -math.expm1(-trajectory.duration_s / thermal.time_constant_s)
        rms_v, continuous = math.sqrt(mean_v2 * warmed), thermal.continuous_voltage_v
        if rms_v > continuous:
            message = f"found {continuous:g}, would always trip: program '{followed}' needs"
            problems.append(
                document.problem(
                    ("axes", axis, "guards", "thermal", "continuous_voltage_v"),
                    f"{message} {rms_v:.3g} V rms; make the program slower, or raise it",
                )
            )
    return problems
