"""Repetition after repetition: run the program, learn from it, keep the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.close_loop.rigs import Rig
from motorctl.config import Machine
from motorctl.config.learned_file import (
    LearnedEntry,
    LearnedTrial,
    cycle_digest,
    learned_path,
    look_up,
    loop_digest,
    rounded,
    write_learned,
)
from motorctl.config.machine import Axis
from motorctl.config.model_keys import models_that_differ
from motorctl.errors import RunError, UsageError
from motorctl.identify.compare.measures import measure_axis
from motorctl.identify.fit.declared_models import machine_of
from motorctl.learn.cycles import MOST_MISSING, Repetition, cycles_of, require_learnable
from motorctl.learn.robust_filter import LearningFilter, learning_filter
from motorctl.learn.update import learnable_rms_m, next_voltage
from motorctl.learn.what_is_added import require_added
from motorctl.log import Recording, read_recording
from motorctl.motion import Program
from motorctl.response.measurement import Measurement
from motorctl.tune.recorded_loop import RecordedLoop, recorded_loop

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

USUAL_REPETITIONS = 6
"""Runs at most, the first without anything new; three or four do. By hand."""
FALLS_BY = 0.95
"""Factor on the least error so far, below which a repetition counts as better. Nearer to 1 goes on
for what noise makes, less stops early. By hand."""
WORTH = 0.05
"""Part of the squared error that stands out of the noise and repeats, below which nothing more is
learned: all of it would lower the rms by a fortieth. Larger stops before the error's peaks are
gone, smaller costs runs. By hand."""
PATIENCE = 2
"""Repetitions in a row without a better one, after which it is over. More costs runs, one lets
chance decide. By hand."""


@dataclass(frozen=True)
class Trial:
    """One run of the program."""

    repetition: Repetition
    eF_m: float  # noqa: N815 (the paper's symbol)

    @property
    def noted(self) -> LearnedTrial:
        """What the file of learned voltages keeps of it."""
        return LearnedTrial(
            eF_m=self.eF_m,
            rms_m=self.repetition.rms_m,
            repeats_rms_m=self.repetition.repeats_rms_m,
            learned_rms_v=float(np.sqrt(np.mean(self.repetition.learned**2))),
        )


@dataclass(frozen=True)
class Learning:
    """What an axis has learned for a program, and how."""

    axis: str
    program: str
    loop: RecordedLoop
    filters: LearningFilter
    limit_v: float
    trials: tuple[Trial, ...]
    """Every run, the first with what had been learned before."""
    before: tuple[LearnedTrial, ...]
    """Those of earlier sessions that this one went on from."""
    best: int | None
    """Number of the trial whose voltage is kept; None: that which nobody has tried yet."""
    volts: tuple[float, ...]
    """What is kept, one cycle [V]."""
    ended: str
    """Why it was over."""

    @property
    def at_limit(self) -> bool:
        """Whether what is kept was cut."""
        return bool(np.max(np.abs(self.volts)) >= self.limit_v * (1.0 - 1e-6))


def require_learning(machine: Machine, name: str) -> tuple[Axis, Program, Path]:
    """Return the axis, the program that it repeats, and the file of what it learns.

    Raises UsageError where one of them is missing, or the program does not repeat.
    """
    if name not in machine.axes:
        known = ", ".join(machine.axes)
        raise UsageError(f"{machine.source}: no axis '{name}'; it has: {known}")
    axis, path = machine.axes[name], learned_path(machine, name)
    if path is None:
        raise UsageError(
            f"{machine.source}: axis {name} does not learn unless it is asked to: write "
            f"`learning: {{file: learned_{name}.json}}` under axes.{name}"
        )
    if axis.program is None:
        raise UsageError(
            f"{machine.source}: axis {name} has no program, so there is nothing that it repeats; "
            f"name one under axes.{name}"
        )
    program = machine.programs[axis.program]
    require_learnable(program)
    return axis, program, path


def learn_by_repeating(
    machine: Machine,
    name: str,
    rig: Rig,
    place: Path,
    folder: Path,
    *,
    repetitions: int = USUAL_REPETITIONS,
    anew: bool = False,
    measured: Measurement | None = None,
    progress: Progress,
) -> Learning:
    """Repeat an axis' program until what repeats of its error is gone, or no longer falls.

    Parameters
    ----------
    machine
        With its models.
    name
        The axis.
    rig
        Runs it.
    place
        The file that the rig takes what was learned from. What it holds when this begins is gone on
        from; what it holds at the end is the best, or what it held before where an axis trips.
    folder
        Of the logs.
    repetitions
        Runs at most.
    anew
        Begin from nothing.
    measured
        The axis' measured response; None: plant and bounds tell what can be learned.
    progress
        Told what is being done, and the share of it that is.

    Raises
    ------
    UsageError
        The machine or the program does not allow it.
    RunError
        An axis trips, or adds another voltage than was written for it.
    """
    axis, program, _ = require_learning(machine, name)
    rig.insist(machine)
    before = place.read_bytes() if place.exists() else None
    entry = None if anew else look_up(machine, name, program, place).entry
    session = _Session(machine, axis, program, entry, measured)
    try:
        if entry is None:
            write_learned(place, program.name, None)
        for k in range(repetitions):
            log = folder / f"learning_{name}_{k}.parquet"
            told = f"{rig.verb} repetition {k + 1} of at most {repetitions}"
            try:
                rig.run(machine, log, None, lambda share, told=told: progress(told, share))  # type: ignore[misc]
                progress("learning from it", 0.0)
                session.add(read_recording(log, gaps="keep"), rig.notes)
            except RunError as error:
                raise RunError(
                    f"repetition {k + 1}: {error}; nothing was learned: what was there before stays"
                ) from error
            if (ended := session.ended) or k + 1 == repetitions:
                break
            session.write(place, session.volts)
        best = session.best
        session.write(place, best.repetition.learned)
    except BaseException:
        _restore(place, before)
        raise
    return session.learning(session.trials.index(best), ended or "as often as was asked for")


def learn_from_log(
    recording: Recording,
    machine: Machine,
    name: str,
    place: Path,
    *,
    anew: bool = False,
    measured: Measurement | None = None,
) -> Learning:
    """Learn from one log of the axis following its program, and write what the next run shall add.

    Parameters
    ----------
    recording
        A log of motorctl's, of this machine's loop.
    machine, name
        The configuration and its axis.
    place
        The file of what was learned.
    anew
        Forget how what was learned before came to be; what the log has of it counts.
    measured
        As of `learn_by_repeating`.

    Raises
    ------
    UsageError
        The machine or the program does not allow it, or the log is of another loop.
    DataError
        The log does not tell what repeats.
    """
    axis, program, _ = require_learning(machine, name)
    _require_same_loop(recording, machine, name)
    entry = None if anew else look_up(machine, name, program, place).entry
    session = _Session(machine, axis, program, entry, measured)
    session.add(recording)
    session.write(place, session.volts)
    return session.learning(None, "from one log, which the next run has to try out")


def _require_same_loop(recording: Recording, machine: Machine, name: str) -> None:
    """Insist that a log is of the loop that will add what is learned from it, its gains included.

    A log that does not tell its loop is refused with what it does tell, by what reads it.
    """
    logged = machine_of(recording)
    if logged is None or name not in logged.axes:
        return
    if loop_digest(logged, name) == loop_digest(machine, name):
        return
    differences = [
        f"  {key}: {was}, here {now}" for key, was, now in models_that_differ(logged, machine, name)
    ]
    raise UsageError(
        "\n".join(
            [
                f"{recording.source}: axis {name} was recorded with another loop than that of "
                f"{machine.source}, which would add what is learned:",
                *(differences or ["  its period, its encoder or limits.max_voltage_v"]),
                "record its program with that configuration first",
            ]
        )
    )


class _Session:
    """The trials so far, and what they led to."""

    def __init__(
        self,
        machine: Machine,
        axis: Axis,
        program: Program,
        entry: LearnedEntry | None,
        measured: Measurement | None,
    ) -> None:
        self._measured = measured
        self._machine = machine
        self._axis = axis
        self._program = program
        self._before = () if entry is None else entry.trials
        self._loop: RecordedLoop | None = None
        self._filters: LearningFilter | None = None
        self.trials: list[Trial] = []
        self.volts: Array = np.zeros(0)
        """What the next repetition shall add."""

    def add(self, recording: Recording, notes: Sequence[str] = ()) -> None:
        name = self._axis.name
        repetition = cycles_of(recording, name, self._program)
        if self.trials:
            require_added(repetition, self.volts, notes)
        if self._filters is None:
            self._loop = recorded_loop(recording, self._machine, name, most_missing=MOST_MISSING)
            self._filters = learning_filter(
                self._loop,
                repetition.period_s,
                repetition.points,
                self._measured,
            )
        measures = measure_axis(recording, name).measures
        self.trials.append(Trial(repetition, measures.eF_m))
        self.volts = next_voltage(repetition, self._filters, self._axis.max_learned_v)

    @property
    def best(self) -> Trial:
        """The trial of least error."""
        return min(self.trials, key=lambda trial: trial.repetition.rms_m)

    @property
    def ended(self) -> str:
        """Why nothing more is to be learned; empty: something is."""
        last = self.trials[-1].repetition
        learnable_m = learnable_rms_m(last)
        if learnable_m <= math.sqrt(WORTH) * last.rms_m:
            return (
                f"what stands out of the noise of {len(last.error)} cycles and repeats, "
                f"{learnable_m * 1e6:.2g} {self._axis.units.error.unit} rms, is not worth "
                "another run"
            )
        errors = [trial.repetition.rms_m for trial in self.trials]
        least, since = errors[0], 0
        for error in errors[1:]:
            since += 1
            if error < FALLS_BY * least:
                least, since = error, 0
        if since >= PATIENCE:
            return "the error no longer fell"
        return ""

    def write(self, place: Path, volts: Array) -> None:
        entry = LearnedEntry(
            program=cycle_digest(self._program, self._axis.name),
            model=loop_digest(self._machine, self._axis.name),
            period_s=self.trials[-1].repetition.period_s,
            volts=rounded(volts),
            trials=(*self._before, *(trial.noted for trial in self.trials)),
        )
        write_learned(place, self._program.name, entry)
        self.volts = volts

    def learning(self, best: int | None, ended: str) -> Learning:
        assert self._loop is not None  # after `add`
        assert self._filters is not None
        return Learning(
            axis=self._axis.name,
            program=self._program.name,
            loop=self._loop,
            filters=self._filters,
            limit_v=self._axis.max_learned_v,
            trials=tuple(self.trials),
            before=self._before,
            best=best,
            volts=rounded(self.volts),
            ended=ended,
        )


def with_place(machine: Machine, name: str, place: Path) -> Machine:
    """Return a machine whose axis has what it learned in another file; nothing else changes."""
    axis = machine.axes[name]
    assert axis.learning is not None  # as `require_learning` has seen
    learning = axis.learning.model_copy(update={"file": str(place.absolute())})
    axes = {**machine.axes, name: axis.model_copy(update={"learning": learning})}
    return replace(machine, axes=axes)


def _restore(place: Path, text: bytes | None) -> None:
    if text is None:
        place.unlink(missing_ok=True)
    else:
        place.write_bytes(text)
