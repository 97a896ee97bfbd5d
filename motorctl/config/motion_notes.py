"""What `check` notes of guards that ordinary motion comes near to, by the model at theta(0)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from motorctl.config import following_motion
from motorctl.config.analysis import required_command
from motorctl.config.following_motion import LawError
from motorctl.config.heat_rules import NEAR, program_heat_v
from motorctl.config.machine import Axis, Machine
from motorctl.config.skew_motion import skew_of_m, squaring_lag_m
from motorctl.motion import Program, RequiredVoltage

UNEVEN = 0.25
"""Part of a program's command by which the ends of a beam may differ: a skew limit that trips there
is noted. Data sheets give a motor's force to a tenth; friction and a load off the middle, each of
which the shipped beam has, are as much again. Larger notes limits that hold, smaller leaves out
such beams: its own trips at 0.13. Chosen by hand."""


def notes_on_motion(machine: Machine) -> Iterator[str]:
    """Yield which guards the axes' programs, and beams that are squared, come near to.

    Parameters
    ----------
    machine
        A checked machine.

    Yields
    ------
    str
        A sentence with the axis, the key and the numbers.
    """
    for name, axis in machine.axes.items():
        yield from _squaring(axis, machine.period_of(name))
        program = machine.programs.get(axis.program) if axis.program else None
        if program is None or name not in program.axes:
            continue
        need = required_command(axis.model, axis.theta_initial, axis.limits.max_voltage_v)
        yield from _heat(axis, program, need, machine.period_of(name))
        yield from _skew(axis, program, need, machine.period_of(name))
        yield from _following(axis, program, machine.period_of(name))


def _heat(axis: Axis, program: Program, need: RequiredVoltage, period_s: float) -> Iterator[str]:
    thermal = axis.guards.thermal
    if thermal is None:
        return
    warmed_v = program_heat_v(thermal, program, axis.name, need, period_s)
    if thermal.continuous_voltage_v < NEAR * warmed_v:
        above = thermal.continuous_voltage_v / warmed_v - 1.0
        yield (
            f"axis {axis.name}: guards.thermal.continuous_voltage_v "
            f"{thermal.continuous_voltage_v:g} V is {above:.0%} above what program "
            f"'{program.name}' needs at theta(0), {warmed_v:.3g} V rms: it may trip where the axis "
            "resists more than its model says, or is loaded more"
        )


def _squaring(axis: Axis, period_s: float) -> Iterator[str]:
    guard, dual, place = axis.guards.skew, axis.dual_drive, axis.model.index_of("direction")
    if guard is None or dual is None or place is None:
        return
    friction_v, skew = axis.estimates[place].initial, dual.skew
    lag_m = squaring_lag_m(dual, guard.limit_m, friction_v, period_s)
    if guard.limit_m <= lag_m:
        yield (
            f"axis {axis.name}: guards.skew.limit_m {guard.limit_m:g} is no more than friction "
            f"holds a beam back by that is squared at {skew.squaring_velocity_m_s:g} m/s, "
            f"{lag_m:.3g} m: {friction_v:g} V at theta(0); it may trip then"
        )


def _skew(axis: Axis, program: Program, need: RequiredVoltage, period_s: float) -> Iterator[str]:
    guard, dual = axis.guards.skew, axis.dual_drive
    if guard is None or dual is None:
        return
    trajectory = program.trajectories()[axis.name]
    cycle_s = trajectory.duration_s / program.cycles
    volts = need(*trajectory.sample(np.arange(0.0, cycle_s, period_s)))
    skewed_m = skew_of_m(dual.skew, volts, period_s)
    if guard.limit_m < UNEVEN * skewed_m:
        yield (
            f"axis {axis.name}: guards.skew.limit_m {guard.limit_m:g} trips in program "
            f"'{program.name}' where the ends differ by {guard.limit_m / skewed_m:.2g} of its "
            f"command, in their motors' force, friction or load: all of it would skew the beam by "
            f"{skewed_m:.3g} m; it may trip below {UNEVEN * skewed_m:.2g} m"
        )


def _following(axis: Axis, program: Program, period_s: float) -> Iterator[str]:
    error, gains, place = (
        axis.limits.following_error,
        axis.gains,
        axis.model.index_of("acceleration"),
    )
    if place is None or gains.command_filter is not None:
        return
    inertia = axis.estimates[place].initial
    own = LawError(gains, inertia, program, axis.name, period_s, error.minimum_m)
    if error.minimum_m < following_motion.NEAR * own.most_m:
        yield (
            f"axis {axis.name}: limits.following_error.minimum_m {error.minimum_m:g} is less than "
            f"{following_motion.NEAR:g} times what the law itself stays behind in program "
            f"'{program.name}', {own.most_m:.3g} m (gains.velocity published): it may trip "
            "where something that no list has adds to that"
        )
