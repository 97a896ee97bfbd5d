"""A model of the motor's heat that ordinary motion always trips: slow motion, or its program."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from motorctl.config.guard_keys import Thermal
from motorctl.config.motor_heat import hottest_v
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.motion import AxisLimits, Program, RequiredVoltage

SLOW_RATIO = 0.1
"""Of the top speed: at such a speed hardly more than friction has to be overcome. Larger adds what
the speed costs, smaller than the friction's turn-over leaves friction out. Chosen by hand."""
PLACES = 201
"""On the travel at which slow motion is looked at. Fewer miss where cogging pulls most, more only
take longer. Chosen by hand."""


def check_heat(
    document: Document,
    programs: Mapping[str, Program],
    thermals: Mapping[str, Thermal],
    limits: Mapping[str, AxisLimits],
    required_voltage: Mapping[str, RequiredVoltage],
    rates_hz: Mapping[str, float],
) -> list[Problem]:
    """Check that neither slow motion nor the program that an axis follows always trips its model.

    The command is the one that the model needs at theta(0); all cycles of the program count, and
    each tick of them is taken as the loop takes it. rates_hz: the axes' own.
    """
    problems = []
    for axis, thermal in thermals.items():
        need, own = required_voltage.get(axis), limits.get(axis)
        if need is None or own is None:
            continue
        followed = document.at(("axes", axis, "program"))
        program = programs.get(followed) if isinstance(followed, str) else None
        told = _slow_heat(thermal, own, need)
        if program is not None and axis in program.axes and axis in rates_hz:
            period_s = 1.0 / rates_hz[axis]
            told = _program_heat(thermal, f"'{followed}'", program, axis, need, period_s) or told
        if told:
            where = ("axes", axis, "guards", "thermal", "continuous_voltage_v")
            message = f"found {thermal.continuous_voltage_v:g}, would always trip: {told}"
            problems.append(document.problem(where, message))
    return problems


def _program_heat(
    thermal: Thermal,
    name: str,
    program: Program,
    axis: str,
    need: RequiredVoltage,
    period_s: float,
) -> str | None:
    trajectory = program.trajectories()[axis]
    warmed_v = hottest_v(
        lambda t: need(*trajectory.sample(t)),
        trajectory.duration_s / program.cycles,
        program.cycles,
        thermal.time_constant_s,
        period_s,
    )
    if warmed_v <= thermal.continuous_voltage_v:
        return None
    return (
        f"at its hottest program {name} needs {warmed_v:.3g} V rms over time_constant_s "
        f"{thermal.time_constant_s:g} s; make the program slower, or raise it"
    )


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
