"""What axes have learned for programs that repeat: one file an axis, an entry a program.

An entry holds for one cycle of one program, and for one model: its digests tell for which.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from motorctl.config.machine import Machine
from motorctl.config.model_keys import model_of
from motorctl.errors import DataError, UsageError
from motorctl.motion import Program

VOLT_DIGITS = 7
"""Digits behind the point with which volts are written: a tenth of a microvolt. Fewer show as steps
beside a converter of 24 bits, more make the file longer. By hand."""
MOST_POINTS = 65536
"""In a cycle: the loop has room for so many."""


class LearnedTrial(BaseModel):
    """One repetition of the program, and what it showed."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    eF_m: FiniteFloat  # noqa: N815 (the paper's symbol)
    """Largest error over the last two periods [m]."""
    rms_m: FiniteFloat
    """Of the error over the cycles that count [m]."""
    repeats_rms_m: FiniteFloat
    """Of that, what every cycle repeats: what can be learned [m]."""
    learned_rms_v: FiniteFloat
    """Of what was added meanwhile [V]."""


class LearnedEntry(BaseModel):
    """What one axis has learned for one program."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    program: str
    """Digest of the axis' motion in one cycle."""
    model: str
    """Digest of the model, its gains and what else makes up the loop."""
    period_s: Annotated[float, Field(gt=0, le=1e9)]
    volts: Annotated[tuple[FiniteFloat, ...], Field(min_length=2, max_length=MOST_POINTS)]
    """One cycle, evenly spaced [V]."""
    trials: tuple[LearnedTrial, ...] = ()
    """How it came to be, the first without anything learned; empty where that is not known."""

    @property
    def values(self) -> NDArray[np.float64]:
        """One cycle, (points,) evenly spaced [V]."""
        return np.array(self.volts)


class _LearnedFile(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    format: Literal["motorctl-learning-1"] = "motorctl-learning-1"
    programs: dict[str, LearnedEntry]


@dataclass(frozen=True)
class Looked:
    """What was found for an axis and a program."""

    entry: LearnedEntry | None
    """None where nothing may be added."""
    why_not: str | None
    """Why what is there is not used; None where nothing is there, or it is used."""


def learned_path(machine: Machine, axis: str) -> Path | None:
    """Return the file of an axis; None where it does not learn."""
    learning = machine.axes[axis].learning
    return None if learning is None else machine.source.absolute().parent / learning.file


def learned_paths(machine: Machine) -> dict[str, Path]:
    """Return the files of all axes that learn, by axis."""
    return {name: path for name in machine.axes if (path := learned_path(machine, name))}


def cycle_digest(program: Program, axis: str) -> str:
    """Return what tells one cycle of an axis' motion from any other's.

    Raises UsageError where the program does not repeat.
    """
    require_repeating(program)
    segments = program.trajectories()[axis].segments
    cycle = segments[: len(segments) // program.cycles]
    return hashlib.sha256(cycle.tobytes()).hexdigest()


def require_repeating(program: Program) -> None:
    """Raise UsageError where a program does not repeat one cycle."""
    if program.period_s is None or program.cycles < 2:
        raise UsageError(
            f"program '{program.name}' does not repeat: learning needs one with `cycles`, at least "
            "2 of them, in which each begins where the last one ended"
        )


def loop_digest(machine: Machine, axis: str) -> str:
    """Return what tells an axis' loop from any other: its name, model, controller, gains, rate.

    What was learned with one is what that one does not explain.
    """
    own = machine.axes[axis]
    model = model_of(machine, axis)
    # A key of gains that is null is as if it were not there: what was learned before there was such
    # a key is learned still.
    gains = {key: value for key, value in model["gains"].items() if value is not None}
    loop = {
        "axis": axis,  # alike in everything, two axes still have errors of their own
        **model,
        "gains": gains,
        "period_s": machine.period_of(axis),
        "encoder": own.encoder.model_dump(),
        "max_voltage_v": own.limits.max_voltage_v,
    }
    return hashlib.sha256(json.dumps(loop, sort_keys=True).encode()).hexdigest()


def look_up(machine: Machine, axis: str, program: Program, path: Path | None = None) -> Looked:
    """Return what an axis has learned for a program, and why it is not used where it is not.

    Parameters
    ----------
    machine
        With the models that run.
    axis
        Its axis.
    program
        One that moves the axis.
    path
        The file; None: as the machine's configuration says.
    """
    path = path or learned_path(machine, axis)
    if path is None or not path.exists() or program.period_s is None or program.cycles < 2:
        return Looked(None, None)
    try:
        entry = read_learned(path).get(program.name)
    except DataError as error:
        return Looked(None, str(error))
    if entry is None:
        return Looked(None, None)
    told = f"axis {axis}: what was learned for program '{program.name}' is not used: it was learned"
    if entry.model != loop_digest(machine, axis):
        return Looked(None, f"{told} with another model: `motorctl learn {axis}` anew")
    if entry.program != cycle_digest(program, axis):
        return Looked(None, f"{told} for another motion of that name: `motorctl learn {axis}` anew")
    limit_v, largest_v = machine.axes[axis].max_learned_v, float(np.abs(entry.values).max())
    if largest_v > limit_v * (1.0 + 1e-9):
        return Looked(
            None,
            f"{told} with more than is allowed: {largest_v:.3g} V, limit {limit_v:.3g} V "
            f"(axes.{axis}.learning.max_share)",
        )
    return Looked(entry, None)


def require_nothing_learned(machine: Machine) -> None:
    """Insist that no axis would add what it learned: errors of models are compared without.

    Raises UsageError with what to do.
    """
    for name, axis in machine.axes.items():
        if axis.program and look_up(machine, name, machine.programs[axis.program]).entry:
            raise UsageError(
                f"{machine.source}: axis {name} has learned for '{axis.program}', which would hide "
                f"what its model does: write `axes.{name}.learning: null`, and learn afterwards"
            )


def notes_on_learning(machine: Machine) -> Iterator[str]:
    """Say what each axis that learns has learned for the program that it follows."""
    for name, axis in machine.axes.items():
        if axis.learning is None or axis.program is None:
            continue
        looked = look_up(machine, name, machine.programs[axis.program])
        if looked.why_not:
            yield looked.why_not
        elif looked.entry is not None:
            largest_v = float(np.abs(looked.entry.values).max())
            yield (
                f"axis {name}: up to {largest_v:.3g} V that it learned for '{axis.program}' is "
                f"added to its command; limit {axis.max_learned_v:.3g} V"
            )
        else:
            yield (
                f"axis {name}: it has learned nothing for '{axis.program}' yet: "
                f"`motorctl learn {name} --config {machine.source}`"
            )


def read_learned(path: Path) -> dict[str, LearnedEntry]:
    """Return the entries of a file by program; none where there is no file.

    Raises DataError where it cannot be read.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        return _LearnedFile.model_validate_json(text).programs
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise DataError(
            f"{path}: is no file of what was learned: {place}: {first['msg']}; remove it, and "
            "`motorctl learn` writes it anew"
        ) from error


def rounded(volts: NDArray[np.float64]) -> tuple[float, ...]:
    """Return volts as they are written."""
    return tuple(np.round(volts, VOLT_DIGITS).tolist())


def write_learned(path: Path, name: str, entry: LearnedEntry | None) -> None:
    """Put a program's entry into a file beside the others, or take it out: whole, or not at all.

    Raises UsageError where it cannot be written, DataError where what is there is no such file.
    """
    programs = read_learned(path)
    if entry is None:
        programs.pop(name, None)
    else:
        programs[name] = entry
    text = _LearnedFile(programs=programs).model_dump_json()
    draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        with draft.open("w", encoding="utf-8") as file:
            file.write(text + "\n")
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
