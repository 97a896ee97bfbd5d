"""The motions of a machine that closes the loop: its own, one that shows much, one never used."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, Literal

import numpy as np

from motorctl.config.analysis import required_command
from motorctl.config.machine import Axis, Machine
from motorctl.errors import UsageError
from motorctl.identify.diagnose.report.motion_advice import (
    Reach,
    Stroke,
    duration_s,
    fast_reversals,
    program_keys,
    roam,
    slow_reversals,
    two_accelerations,
    two_speeds,
)
from motorctl.motion import Moves, Program, check_program

MotionName = Literal["own", "rich", "unused"]

CLEARANCE = 0.05
"""Part of the travel that is kept free at either end."""
SPEED = 0.9
"""Of what the axis' own programs reach, else of its limit."""
ACCELERATION = 0.85
VOLTAGE = 0.7
"""Of the limit: what motion may need where no program of its own tells what the axis can do."""
UNUSED_BEGIN = 0.37
"""Makes another sequence of random moves."""
MOST_MOVES = 4000
ROAMING = 8
"""Moves at random between two other pieces of the rich motion."""
ACCELERATION_STEPS = 50


@dataclass(frozen=True)
class Motions:
    """How long the motions last that are made for the machine, and how hard they drive it."""

    rich_s: float = 24.0
    unused_s: float = 20.0
    effort: float = 1.0
    """Below 1 where the machine could not follow."""


def machine_on(machine: Machine, motion: MotionName, motions: Motions) -> Machine:
    """Return the machine with each axis on a program of this motion.

    The machine's own motion is left as it is, and an axis without a program then holds.
    """
    if motion == "own":
        return machine
    programs: dict[str, Program] = {}
    axes: dict[str, Axis] = {}
    for k, (name, axis) in enumerate(machine.axes.items()):
        program = _made(machine, axis, motion, motions, k)
        programs[program.name] = program
        axes[name] = axis.model_copy(update={"program": program.name})
    resolved: dict[str, Any] = copy.deepcopy(dict(machine.resolved))
    for name, axis in axes.items():
        resolved["axes"][name]["program"] = axis.program
    resolved["programs"] = {
        name: program.model_dump(mode="json", exclude={"name"})
        for name, program in programs.items()
        if isinstance(program, Moves)
    }
    return replace(machine, axes=axes, programs=programs, resolved=resolved)


def moves_by_itself(machine: Machine) -> bool:
    """Return whether every axis follows a program of its own."""
    return all(axis.program is not None for axis in machine.axes.values())


def _made(machine: Machine, axis: Axis, motion: MotionName, motions: Motions, k: int) -> Program:
    """Make an axis' program: different for every axis, so that no two move in step."""
    reach = _reach(machine, axis, motions.effort)
    if motion == "rich":
        strokes = _cut(reach, _rich(reach, 0.173 * k), motions.rich_s)
    else:
        strokes = _cut(reach, roam(reach, MOST_MOVES, UNUSED_BEGIN + 0.173 * k), motions.unused_s)
    keys = program_keys(axis.name, reach, strokes)
    program = Moves.model_validate({**keys, "name": f"{motion}_{axis.name}"})
    if violations := check_program(program, {axis.name: axis.limits.for_motion()}):
        raise UsageError(f"axis {axis.name}: no motion within its limits: {violations[0]}")
    return program


def _rich(reach: Reach, begin: float) -> Iterator[Stroke]:
    """Yield moves at random, and between them what shows one thing well; without end."""
    for k in count():
        for recipe in (fast_reversals, two_speeds, slow_reversals, two_accelerations):
            yield from roam(reach, ROAMING, begin + 0.31 * k)
            yield from recipe(reach)


def _cut(reach: Reach, strokes: Iterator[Stroke], length_s: float) -> list[Stroke]:
    """Take strokes until they last long enough."""
    taken: list[Stroke] = []
    lasting_s, at = 0.0, Stroke(0.5)
    for stroke in strokes:
        lasting_s += duration_s(reach, [at, stroke]) - duration_s(reach, [at])
        taken.append(stroke)
        at = stroke
        if lasting_s >= length_s or len(taken) >= MOST_MOVES:
            break
    return taken


def _reach(machine: Machine, axis: Axis, effort: float) -> Reach:
    """Return how far, fast and hard the axis may be driven.

    No harder than by its own programs, which the machine is known to follow; where it has none,
    as hard as a part of its voltage allows.
    """
    limits = axis.limits
    low, high = limits.travel_m
    free = CLEARANCE * (high - low)
    speed, acceleration, jerk = (
        limits.max_velocity_m_s,
        limits.max_acceleration_m_s2,
        limits.max_jerk_m_s3,
    )
    own = [p for p in machine.programs.values() if axis.name in p.axes]
    if own:
        peaks = [program.trajectories()[axis.name].peaks() for program in own]
        speed = min(speed, max(peak.max_velocity_m_s for peak in peaks))
        acceleration = min(acceleration, max(peak.max_acceleration_m_s2 for peak in peaks))
        jerk = min(jerk, max(peak.max_jerk_m_s3 for peak in peaks))
    else:
        acceleration = _affordable(axis, SPEED * speed, acceleration)
    return Reach(
        low + free,
        high - free,
        SPEED * effort * speed,
        ACCELERATION * effort * acceleration,
        effort * jerk,
    )


def _affordable(axis: Axis, speed: float, acceleration: float) -> float:
    """Return the acceleration that a part of the voltage makes at a speed, by the start values."""
    limit = axis.limits.max_voltage_v
    needed = required_command(axis.model, axis.theta_initial, limit)
    a = np.linspace(acceleration / ACCELERATION_STEPS, acceleration, ACCELERATION_STEPS)
    x = np.full_like(a, 0.5 * sum(axis.limits.travel_m))
    enough = np.abs(needed(x, np.full_like(a, speed), a)) <= VOLTAGE * limit
    return float(a[enough].max() if enough.any() else a[0])
