"""The programs of a configuration: built, and compared with the limits of the axes they move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from motorctl.axis_units import LINEAR, AxisUnits, units_in
from motorctl.config.validation import shown, suggest
from motorctl.errors import ConfigError, MotorctlError, Problem
from motorctl.located_yaml import Document, KeyPath
from motorctl.motion import (
    AxisLimits,
    Circle,
    Program,
    RequiredVoltage,
    Violation,
    check_program,
    parse_program,
)

_WORDS = ("kind", "axis", "axes", "file", "name")
"""Keys of programs whose values are text."""

_LIMITS = {
    "position": "travel_m",
    "velocity": "max_velocity_m_s",
    "acceleration": "max_acceleration_m_s2",
    "jerk": "max_jerk_m_s3",
    "voltage": "max_voltage_v",
}


def build_programs(document: Document, directory: Path) -> tuple[dict[str, Program], list[Problem]]:
    """Build every program.

    Returns
    -------
    tuple
        Those without problems, and the problems of the others. Files of points are looked for in
        `directory`.
    """
    names = [str(name) for name in document.part(("axes",))]
    found: dict[str, Program] = {}
    problems: list[Problem] = []
    for name, part in document.part(("programs",)).items():
        path = ("programs", name)
        if not isinstance(part, dict) or not isinstance(part.get("kind"), str):
            continue
        own = _check_numbers(document, path, part)
        noted = {problem.key for problem in own}
        try:
            program = parse_program(
                name,
                part,
                directory=directory,
                axis_names=names,
                file=document.file,
                line_of=partial(_line, document, path),
                prefix=f"programs.{name}.",
            )
            program.trajectories()
        except ConfigError as error:
            for problem in error.problems:
                if problem.file != document.file and problem.line is None:
                    message = f"{problem.file}: {problem.message}"
                    own.append(document.problem((*path, "file"), message))
                elif problem.key not in noted:
                    own.append(problem)
        except MotorctlError as error:
            own.append(document.problem(path, str(error)))
        else:
            if not own:
                found[name] = program
        units = _units(document, part)
        problems += [replace(problem, message=units.words(problem.message)) for problem in own]
    return found, problems


def _units(document: Document, part: Mapping[str, Any]) -> AxisUnits:
    """Return the units of a program: of its axis, or of the first of several."""
    axes = part.get("axes")
    axis = part.get("axis") or (axes[0] if isinstance(axes, list) and axes else None)
    return units_in(document.data, axis) if isinstance(axis, str) else LINEAR


def _line(document: Document, path: KeyPath, location: KeyPath) -> int | None:
    return document.line((*path, *location))


def check_programs(
    document: Document,
    programs: Mapping[str, Program],
    limits: Mapping[str, AxisLimits],
    required_voltage: Mapping[str, RequiredVoltage],
) -> list[Problem]:
    """Compare every program with the limits of its axes, where all of these could be read."""
    problems: list[Problem] = []
    for name, program in programs.items():
        if not all(axis in limits for axis in program.axes):
            continue
        path = ("programs", name)
        if message := mixed_kinds(program, {a: units_in(document.data, a) for a in program.axes}):
            problems.append(document.problem((*path, "axes"), message))
        try:
            violations = check_program(program, limits, required_voltage)
        except MotorctlError as error:
            problems.append(document.problem(path, str(error)))
            continue
        problems += [
            document.problem(path, units_in(document.data, v.axis).words(_told(v)))
            for v in violations
        ]
    return problems


def mixed_kinds(program: Program, units: Mapping[str, AxisUnits]) -> str | None:
    """Return why a program cannot be of its axes' kinds, None where it can; units are by axis."""
    if not isinstance(program, Circle) or len({units[axis].kind for axis in program.axes}) == 1:
        return None
    return f"axes {' and '.join(program.axes)}: a circle needs two axes of one kind"


def followed_program(
    document: Document, axis: str, programs: Mapping[str, Program]
) -> Program | None:
    """Return the program that an axis follows; None where it has none that is sound and moves it.

    Parameters
    ----------
    document
        The configuration.
    axis
        Its name.
    programs
        Those that could be read.
    """
    name = document.at(("axes", axis, "program"))
    program = programs.get(name) if isinstance(name, str) else None
    return program if program is not None and axis in program.axes else None


def check_followed(document: Document, axis: str, programs: Mapping[str, Program]) -> list[Problem]:
    """Check that the program that an axis follows, if any, exists and moves this axis."""
    path = ("axes", axis, "program")
    program = document.at(path)
    if not isinstance(program, str):
        return []
    known = list(document.part(("programs",)))
    if program not in known:
        message = f"unknown program '{program}'; {suggest(program, known)}"
        return [document.problem(path, message)]
    if program in programs and axis not in programs[program].axes:
        moves = ", ".join(programs[program].axes)
        return [document.problem(path, f"program '{program}' moves {moves}, not this axis")]
    return []


def _told(violation: Violation) -> str:
    return f"{violation} (axes.{violation.axis}.limits.{_LIMITS[violation.quantity]})"


def _check_numbers(document: Document, path: KeyPath, part: Mapping[str, Any]) -> list[Problem]:
    """Find text and truth values where numbers belong: only words stand as text in a program."""
    problems = []
    for key, value in part.items():
        if key in _WORDS:
            continue
        for index, item in enumerate(value) if isinstance(value, list) else ((None, value),):
            if isinstance(item, str | bool):
                where = (*path, key) if index is None else (*path, key, index)
                message = f"found {shown(item)}, should be a number"
                problems.append(document.problem(where, message))
    return problems
