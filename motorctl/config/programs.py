"""The programs of a configuration: built, and compared with the limits of the axes they move."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from motorctl.config.document import Document, KeyPath
from motorctl.config.validation import shown, suggest
from motorctl.errors import ConfigError, MotorctlError
from motorctl.motion import (
    AxisLimits,
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


def build_programs(document: Document, directory: Path) -> dict[str, Program]:
    """Build every program; those with problems are noted and left out.

    `directory` is where the files of points are looked for.
    """
    parts = document.at(("programs",))
    axes = document.at(("axes",))
    names = [str(name) for name in axes] if isinstance(axes, dict) else []
    found: dict[str, Program] = {}
    for name, part in (parts if isinstance(parts, dict) else {}).items():
        path = ("programs", name)
        if not isinstance(part, dict) or not isinstance(part.get("kind"), str):
            continue
        before = len(document.problems)
        _check_numbers(document, path, part)
        noted = {problem.key for problem in document.problems[before:]}
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
                    document.add((*path, "file"), f"{problem.file}: {problem.message}")
                elif problem.key not in noted:
                    document.problems.append(problem)
        except MotorctlError as error:
            document.add(path, str(error))
        else:
            if len(document.problems) == before:
                found[name] = program
    return found


def _line(document: Document, path: KeyPath, location: KeyPath) -> int | None:
    return document.line((*path, *location))


def check_programs(
    document: Document,
    programs: Mapping[str, Program],
    limits: Mapping[str, AxisLimits],
    required_voltage: Mapping[str, RequiredVoltage],
) -> None:
    """Compare every program with the limits of its axes, where all of these could be read."""
    for name, program in programs.items():
        if not all(axis in limits for axis in program.axes):
            continue
        try:
            violations = check_program(program, limits, required_voltage)
        except MotorctlError as error:
            document.add(("programs", name), str(error))
            continue
        for violation in violations:
            document.add(("programs", name), _told(violation))


def check_followed(document: Document, axis: str, programs: Mapping[str, Program]) -> None:
    """Check that the program that an axis follows, if any, exists and moves this axis."""
    path = ("axes", axis, "program")
    program = document.at(path)
    if not isinstance(program, str):
        return
    parts = document.at(("programs",))
    known = list(parts) if isinstance(parts, dict) else []
    if program not in known:
        document.add(path, f"unknown program '{program}'; {suggest(program, known)}")
    elif program in programs and axis not in programs[program].axes:
        moves = ", ".join(programs[program].axes)
        document.add(path, f"program '{program}' moves {moves}, not this axis")


def _told(violation: Violation) -> str:
    return f"{violation} (axes.{violation.axis}.limits.{_LIMITS[violation.quantity]})"


def _check_numbers(document: Document, path: KeyPath, part: Mapping[str, Any]) -> None:
    """Note text and truth values where numbers belong: only words stand as text in a program."""
    for key, value in part.items():
        if key in _WORDS:
            continue
        for index, item in enumerate(value) if isinstance(value, list) else ((None, value),):
            if isinstance(item, str | bool):
                where = (*path, key) if index is None else (*path, key, index)
                document.add(where, f"found {shown(item)}, should be a number")
