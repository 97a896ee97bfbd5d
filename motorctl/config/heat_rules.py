"""A model of the motor's heat that ordinary motion always trips: slow motion, or its program."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from motorctl.config.axis_keys import Encoder, Gains
from motorctl.config.guard_keys import Thermal
from motorctl.config.loop_rules import filter_of
from motorctl.config.motor_heat import hottest_v
from motorctl.config.programs import followed_program
from motorctl.config.rules import HIGHEST_FILTER
from motorctl.control import CommandFilter
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.motion import AxisLimits, Program, RequiredVoltage

SLOW_RATIO = 0.1
"""Of the top speed: at such a speed hardly more than friction has to be overcome. Larger adds what
the speed costs, smaller than the friction's turn-over leaves friction out. Chosen by hand."""
WARM = 1.05
"""How much more command a warm motor needs for the same force than the cold one of theta(0). At its
limit of heat its magnets are some 50 K warmer, and neodymium loses 0.1 % a kelvin. Larger refuses
limits that hold, smaller accepts those that trip once the motor is warm. Data sheets of magnets."""
LARGEST_TIME_CONSTANT_S = 7200.0
"""Thermal time constant of the largest motors, of their housing [s]; windings have minutes. Larger
accepts models that warm up over days, smaller refuses motors that there are. Chosen by hand, after
catalogues of motors up to some hundred kilowatts."""
NEAR = 1.3
"""Times what the model says that a program needs: a limit below that is noted. The published gantry
needs 1.27 times as much as its theta(0) says, as cogging is in no list there. Larger notes limits
that nothing comes near to, smaller leaves such machines out. Measured, rounded."""
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
    noises_v: Mapping[str, float],
) -> list[Problem]:
    """Check that neither slow motion nor the program that an axis follows always trips its model.

    The command is the one that the model needs at theta(0), of a warm motor, with what the steps of
    the count add; all cycles of the program count, and each tick of them is taken as the loop takes
    it. rates_hz: the axes' own; noises_v: what counts add to their commands, from `count_noise_v`.
    """
    problems = []
    for axis, thermal in thermals.items():
        need, own = required_voltage.get(axis), limits.get(axis)
        if own and (told := _never_warm(thermal, own.max_voltage_v)):
            where = ("axes", axis, "guards", "thermal", "time_constant_s")
            problems.append(document.problem(where, told))
        if need is None or own is None or axis not in noises_v:
            continue
        program = followed_program(document, axis, programs)
        noise_v = noises_v[axis]
        told = _slow_heat(thermal, own, need, noise_v)
        if program is not None and axis in rates_hz:
            period_s = 1.0 / rates_hz[axis]
            warmed_v = program_heat_v(thermal, program, axis, need, period_s)
            if warm_v(warmed_v, noise_v) > thermal.continuous_voltage_v:
                told = (
                    f"at its hottest program '{program.name}' needs {warmed_v:.3g} V rms over "
                    f"time_constant_s {thermal.time_constant_s:g} s at theta(0)"
                    f"{_in_all(warmed_v, noise_v)}; make the program slower, or raise it"
                )
        if told:
            where = ("axes", axis, "guards", "thermal", "continuous_voltage_v")
            message = f"found {thermal.continuous_voltage_v:g}, would always trip: {told}"
            problems.append(document.problem(where, message))
    return problems


def count_noise_v(gains: Gains, encoder: Encoder, rate_hz: float, ends: int) -> float:
    """Return what the steps of the count add to the command of an axis that moves, as rms [V].

    A count is off by up to half of one, evenly, so that the difference of two has an rms of a count
    by sqrt(6); ks makes a command of its rate. The mean of two encoders has sqrt(2) less. A filter
    of the command takes or adds its part; one that the rate is too low for is refused elsewhere.
    """
    noise_v = gains.ks_v_s_m * encoder.resolution_m * rate_hz / math.sqrt(6.0 * ends)
    keys = gains.command_filter
    if keys is None or keys.frequency_hz > HIGHEST_FILTER * rate_hz:
        return noise_v
    own = filter_of(gains, 1.0 / rate_hz)
    return noise_v if own is None else noise_v * _share_of_steps(own)


def _share_of_steps(own: CommandFilter) -> float:
    """Return the rms of differences of white noise behind a filter, over that before it.

    The variance of the states of (1 - 1/z) H, driven by white noise, is P = A P A' + B B'.
    """
    tail = np.array([own.a1, own.a2, 0.0])
    c = np.convolve([1.0, -1.0], [own.b0, own.b1, own.b2])
    A = np.array([-tail, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    driven = np.zeros(9)
    driven[0] = 1.0
    P = np.linalg.solve(np.eye(9) - np.kron(A, A), driven).reshape(3, 3)
    out = c[1:] - c[0] * tail
    return math.sqrt((c[0] ** 2 + out @ P @ out) / 2.0)


def program_heat_v(
    thermal: Thermal, program: Program, axis: str, need: RequiredVoltage, period_s: float
) -> float:
    """Return how hot a program makes an axis' motor, as the command that would keep it so [V]."""
    trajectory = program.trajectories()[axis]
    return hottest_v(
        lambda t: need(*trajectory.sample(t)),
        trajectory.duration_s / program.cycles,
        program.cycles,
        thermal.time_constant_s,
        period_s,
    )


def warm_v(model_v: float, noise_v: float) -> float:
    """Return the rms command of a warm motor [V], of what the model needs and counts add."""
    return math.hypot(WARM * model_v, noise_v)


def _in_all(model_v: float, noise_v: float) -> str:
    return (
        f", and {warm_v(model_v, noise_v):.3g} V with {WARM - 1.0:.0%} more for a warm motor and "
        f"{noise_v:.2g} V rms that the steps of the count add"
    )


def _never_warm(thermal: Thermal, full_v: float) -> str | None:
    """Return what is wrong with a time constant that no motor has, None where nothing is."""
    tau_s, share = thermal.time_constant_s, (thermal.continuous_voltage_v / full_v) ** 2
    if tau_s <= LARGEST_TIME_CONSTANT_S or share >= 1.0:
        return None
    hours = -tau_s * math.log1p(-share) / 3600.0
    return (
        f"found {tau_s:g}, can hardly ever trip: max_voltage_v {full_v:g} V would have to stand "
        f"for {hours:.3g} h, and from ordinary work the motor would warm up over days; the largest "
        f"motors have {LARGEST_TIME_CONSTANT_S:g} s, windings minutes; should be at most that"
    )


def _slow_heat(
    thermal: Thermal, limits: AxisLimits, need: RequiredVoltage, noise_v: float
) -> str | None:
    """Look at slow motion back and forth, with nothing to accelerate."""
    places, speed = np.linspace(*limits.travel_m, PLACES), SLOW_RATIO * limits.max_velocity_m_s
    there, back = (need(places, np.full(PLACES, v), np.zeros(PLACES)) for v in (speed, -speed))
    rms_v = math.sqrt(float(np.mean(there**2 + back**2)) / 2.0)
    if warm_v(rms_v, noise_v) <= thermal.continuous_voltage_v:
        return None
    return (
        f"slow motion back and forth, at {speed:g} m/s, needs {rms_v:.3g} V rms for friction and "
        f"load at theta(0){_in_all(rms_v, noise_v)}; should be more"
    )
