"""Whether a log was recorded with the loop whose gains are to be chosen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from motorctl.config.machine import Axis, Machine
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import IN_FORCE
from motorctl.identify.same_axis import require_same_machine
from motorctl.log import AxisRecording, Recording

UNEVEN = 1.5
"""Distance of two rows, in periods of the log, from which rows are missing between them. Nearer to
1 trips over rounded times, from 2 on a lost row passes."""


def require_same_loop(recording: Recording, logged: Machine, machine: Machine, name: str) -> None:
    """Insist that a log's error is what the configuration's loop would leave, but for its gains.

    Parameters
    ----------
    recording, logged
        The log, and the machine that its own configuration describes.
    machine
        The configuration whose gains are chosen.
    name
        The axis; both machines have it.

    Raises
    ------
    UsageError
        Rate, model, controller or whatever else the loop is made of differs.
    DataError
        Encoder, travel or voltage are those of another machine.
    """
    require_same_machine(recording, machine, [name])
    differences = list(_differences(logged, machine, name))
    if differences:
        raise UsageError(
            f"{recording.source}: axis {name} was recorded with another loop than that of "
            f"{machine.source}:\n"
            + "\n".join(f"  {key}: {was}, here {now}" for key, was, now in differences)
            + "\nrecord its program with that configuration first"
        )


def require_sound_rows(recording: Recording, name: str, rows: slice, most_missing: int = 0) -> None:
    """Insist that the axis followed its program in all of these rows, and that none is missing.

    most_missing is how many may be, between two. Raises DataError with the time at which it is not
    so.
    """
    axis = recording.axes[name]
    time_s = recording.time_s[rows]
    wrong = _first(_not_in_force(axis, rows))
    if wrong is not None:
        raise DataError(
            f"{recording.source}: axis {name}: it was off, homing or in fault at "
            f"{time_s[wrong]:.3f} s: give a log in which it follows its program to the end"
        )
    if axis.excitation is not None and np.any(axis.excitation[rows]):
        raise DataError(
            f"{recording.source}: axis {name}: it was excited for a frequency response in the rows "
            "that count: its error is not that of its program"
        )
    steps = np.diff(time_s) * recording.sample_rate_hz
    lost = _first(steps > UNEVEN + most_missing)
    if lost is None and axis.recorded is not None:
        lost = _first(~axis.recorded[rows])
    if lost is not None:
        raise DataError(
            f"{recording.source}: axis {name}: rows are missing at {time_s[lost]:.3f} s: give a "
            "log whose last periods are whole"
        )


def require_nothing_learned(recording: Recording, name: str) -> None:
    """Insist that no learned voltage lowered the axis' error: other gains would drop it.

    Raises DataError where one did.
    """
    learned = recording.axes[name].learned
    if learned is not None and np.any(learned):
        raise DataError(
            f"{recording.source}: axis {name}: what it had learned for its program was in the "
            f"command: record it with `axes.{name}.learning: null`, tune, then learn anew"
        )


def _differences(logged: Machine, machine: Machine, name: str) -> Iterator[tuple[str, str, str]]:
    before, now = logged.axes[name], machine.axes[name]
    periods = (logged.period_of(name), machine.period_of(name))
    if abs(periods[0] - periods[1]) > 1e-9 * periods[0]:
        yield "period [s]", f"{periods[0]:g}", f"{periods[1]:g}"
    pairs = {
        "controller": (before.controller, now.controller),
        "encoder": (before.encoder, now.encoder),
        "dual_drive": (before.dual_drive, now.dual_drive),
        "adaptation": (before.adaptation, now.adaptation),
        "limits.max_voltage_v": (before.limits.max_voltage_v, now.limits.max_voltage_v),
        "gains.velocity": (before.gains.velocity, now.gains.velocity),
        "model": (_effects(before), _effects(now)),
        "program": (_motion(logged, before), _motion(machine, now)),
    }
    if not now.adaptation.enabled:  # else what was learned counts, not where it began
        pairs["start values"] = (_start(before), _start(now))
    if not (before.program and now.program):
        del pairs["program"]
    for key, (was, is_) in pairs.items():
        if was != is_:
            yield key, str(was), str(is_)


def _motion(machine: Machine, axis: Axis) -> str:
    """Return an axis' program in words, but for how often it is repeated."""
    programs = machine.resolved["programs"]
    assert isinstance(programs, Mapping)
    program = programs.get(axis.program, {})
    return ", ".join(f"{key}: {value}" for key, value in program.items() if key != "cycles")


def _start(axis: Axis) -> str:
    names = axis.model.parameter_names
    return ", ".join(
        f"{n}: {value:.6g}" for n, value in zip(names, axis.theta_initial, strict=True)
    )


def _effects(axis: Axis) -> str:
    told = []
    for effect in axis.model.effects:
        options = effect.options.model_dump()
        words = ", ".join(f"{key}: {value}" for key, value in options.items())
        told.append(f"{effect.name} ({words})" if words else effect.name)
    return ", ".join(told)


def _not_in_force(axis: AxisRecording, rows: slice) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    wrong = np.zeros(len(axis.position[rows]), dtype=np.bool_)
    if axis.state is not None:
        wrong |= ~np.isin(axis.state[rows], IN_FORCE)
    if axis.fault is not None:
        wrong |= axis.fault[rows] != 0
    return wrong


def _first(flags: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> int | None:
    found = np.flatnonzero(flags)
    return int(found[0]) if len(found) else None
