"""What users do wrong with recordings, done to clean machines, and the words that tell it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from motorctl.errors import UsageError
from motorctl.identify.columns.measured import Array, Measured
from motorctl_benchmarks.other_machines.machine_recording import MachineRecording

PREFIX = "mistake_"
MACHINE = "none"
"""The kind of machine that is recorded wrongly."""
LATE_S, LATE_SAMPLES = 6e-3, 3
"""How late the command is, and the fewest samples of it."""
STUCK_AT, MOVING = 0.55, 0.3
"""The encoder sticks from this part of the recording on, once it moves at this part of its top
speed."""
ANOTHER_SEED = 1000
"""How far away the machine is whose command is taken, or that has the reference that is needed."""
MOST_SEEDS = 12
"""Machines that are drawn until one records a reference."""


Another = Callable[[], MachineRecording]


@dataclass(frozen=True)
class Mistake:
    """One kind of mistake."""

    make: Callable[[Measured, Another], Measured]
    """Of a sound recording, and what draws that of another machine."""
    told_by: str
    """A pattern of the words that tell it and no other."""
    needs_reference: bool = False


def told(words: str) -> tuple[str, ...]:
    """Return the kinds of mistake that an answer tells."""
    return tuple(kind for kind, mistake in MISTAKES.items() if re.search(mistake.told_by, words))


def _reversed_command(data: Measured, _: Another) -> Measured:
    return replace(data, command=-data.command)


def _reversed_reference(data: Measured, _: Another) -> Measured:
    return replace(data, reference=-_reference(data))


def _another_unit(data: Measured, _: Another) -> Measured:
    """Write degrees or millimetres and declare radians or metres; the reference is right."""
    factor = 180.0 / np.pi if data.position_unit == "rad" else 1e3
    _reference(data)
    resolution = None if data.resolution is None else factor * data.resolution
    return replace(data, position=factor * data.position, resolution=resolution)


def _wrong_pitch(data: Measured, _: Another) -> Measured:
    """Count every line of the encoder twice; the reference is right."""
    _reference(data)
    resolution = None if data.resolution is None else 2.0 * data.resolution
    return replace(data, position=2.0 * data.position, resolution=resolution)


def _late_command(data: Measured, _: Another) -> Measured:
    samples = max(LATE_SAMPLES, round(LATE_S * data.sample_rate_hz))
    late = np.concatenate([np.full(samples, data.command[0]), data.command[:-samples]])
    return replace(data, command=late)


def _stuck_encoder(data: Measured, _: Another) -> Measured:
    width = max(1, round(2e-3 * data.sample_rate_hz))
    speed = np.abs(data.position[width:] - data.position[:-width])
    first = int(STUCK_AT * len(speed))
    at = first + int(np.argmax(speed[first:] > MOVING * speed.max()))
    position = data.position.copy()
    position[at:] = position[at]
    return replace(data, position=position)


def _command_of_another(data: Measured, another: Another) -> Measured:
    other = another()
    command = np.interp(data.time_s, other.time_s, other.command, period=float(other.time_s[-1]))
    return replace(data, command=command)


def _reference(data: Measured) -> Array:
    if data.reference is None:
        raise UsageError("this machine records no reference")
    return data.reference


MISTAKES: Mapping[str, Mistake] = {
    f"{PREFIX}reversed_command": Mistake(_reversed_command, "inertia be negative.*reversed"),
    f"{PREFIX}reversed_reference": Mistake(_reversed_reference, "reference runs against", True),
    f"{PREFIX}another_unit": Mistake(
        _another_unit, "degrees for radians|millimetres for metres", True
    ),
    f"{PREFIX}wrong_pitch": Mistake(
        _wrong_pitch, r"position is (1\.9|2)\S* times the reference", True
    ),
    f"{PREFIX}late_command": Mistake(_late_command, "ms before it was recorded"),
    f"{PREFIX}stuck_encoder": Mistake(_stuck_encoder, "the position freezes"),
    f"{PREFIX}command_of_another": Mistake(
        _command_of_another, "the command explains none of the acceleration"
    ),
}
"""By kind."""
