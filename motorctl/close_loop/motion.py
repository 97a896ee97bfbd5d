"""The motions of a machine that closes the loop: its own, one that shows much, one never used."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, Literal

from motorctl.config.machine import Axis, Machine
from motorctl.errors import UsageError
from motorctl.experiment.reach import reach_in_envelope
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

UNUSED_BEGIN = 0.37
"""Makes another sequence of random moves."""
MOST_MOVES = 4000
ROAMING = 8
"""Moves at random between two other pieces of the rich motion."""


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
    return with_programs(
        machine,
        [_made(machine, axis, motion, motions, k) for k, axis in enumerate(machine.axes.values())],
    )


def with_programs(machine: Machine, made: Sequence[Moves]) -> Machine:
    """Return the machine with these programs instead of its own; each axis follows its one."""
    programs: dict[str, Program] = {program.name: program for program in made}
    by_axis = {program.axis: program.name for program in made}
    axes = {
        name: axis.model_copy(update={"program": by_axis.get(name)})
        for name, axis in machine.axes.items()
    }
    resolved: dict[str, Any] = copy.deepcopy(dict(machine.resolved))
    for name, axis in axes.items():
        resolved["axes"][name]["program"] = axis.program
    resolved["programs"] = {
        program.name: program.model_dump(mode="json", exclude={"name"}) for program in made
    }
    return replace(machine, axes=axes, programs=programs, resolved=resolved)


def moves_by_itself(machine: Machine) -> bool:
    """Return whether every axis follows a program of its own."""
    return all(axis.program is not None for axis in machine.axes.values())


def _made(machine: Machine, axis: Axis, motion: MotionName, motions: Motions, k: int) -> Moves:
    """Make an axis' program: different for every axis, so that no two move in step."""
    reach = reach_in_envelope(machine, axis, motions.effort)
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
