"""Record what tells most: one short motion after the other, each chosen by what is still open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from motorctl.close_loop.motion import Motions, with_programs
from motorctl.close_loop.rigs import Rig
from motorctl.close_loop.trial import Progress, gentler_until_followed
from motorctl.config import Machine, load
from motorctl.errors import DataError, UsageError
from motorctl.experiment.candidates import BEGINS, ROAMING, Candidate, probe
from motorctl.experiment.reach import reach_in_envelope
from motorctl.experiment.session import Experiment, Standing, next_experiment, standing
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.report.motion_advice import GOLDEN, Reach, program_keys, roam
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.same_axis import declared_inertias
from motorctl.log import Recording, read_recording
from motorctl.log.joined import joined
from motorctl.motion import Moves

BETWEEN_S = 0.05
"""Rest between two motions [s]: the axes begin the next one together."""
PROBE_SHARE = 0.5
"""Of the time of all motions, what the first one may take. Larger leaves too little for those that
are chosen by what it shows, smaller lets it show less of the travel on slow machines. By hand."""


@dataclass(frozen=True)
class Telling:
    """What was run, and what it left open."""

    recording: Recording
    experiments: tuple[Experiment, ...]
    standing: Standing
    motions: Motions
    diagnosis: RecordingDiagnosis
    ended: str
    """Why it stopped."""

    @property
    def duration_s(self) -> float:
        """Time in motion."""
        return sum(each.duration_s for each in self.experiments)


@dataclass
class _Pieces:
    """The moves of every axis, piece after piece, each as long as the longest of its axes."""

    machine: Machine
    moves: dict[str, list[dict[str, object]]] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)

    def add(self, candidate: Candidate, reaches: Mapping[str, Reach]) -> None:
        """Append a motion; an axis that it does not move rests meanwhile."""
        whole_s = math.ceil(1e3 * candidate.lasts_s(reaches)) / 1e3 + BETWEEN_S
        for axis, reach in reaches.items():
            keys = program_keys(axis, reach, candidate.strokes.get(axis, ()))
            self.start.setdefault(axis, float(keys["start_m"]))  # type: ignore[arg-type]
            moves: list[dict[str, object]] = [dict(m) for m in keys["moves"]]  # type: ignore[attr-defined]
            moves[-1]["target_m"] = self.start[axis]
            lasts_s = self._program(axis, moves).trajectories()[axis].duration_s
            moves[-1]["dwell_s"] = float(moves[-1]["dwell_s"]) + whole_s - lasts_s  # type: ignore[arg-type]
            self.moves.setdefault(axis, []).extend(moves)

    def on(self) -> Machine:
        """Return the machine with each axis on all of its moves."""
        return with_programs(
            self.machine, [self._program(axis, moves) for axis, moves in self.moves.items()]
        )

    def _program(self, axis: str, moves: Sequence[Mapping[str, object]]) -> Moves:
        return Moves.model_validate(
            {"name": f"telling_{axis}", "axis": axis, "start_m": self.start[axis], "moves": moves}
        )


def record_telling(
    config: Path,
    folder: Path,
    motions: Motions,
    rig: Rig,
    progress: Progress,
    axes: Sequence[str] | None = None,
) -> Telling:
    """Run motions until nothing is left that one could settle, or `motions.rich_s` are used up.

    Where virtual time begins anew with every run, what was run before is run again in front: the
    machine behaves as one that ran on. On the machine itself only what is new is run, and the
    recordings are joined.

    Parameters
    ----------
    config
        The machine, with the models that shall run.
    folder
        Where the logs go.
    motions
        How long all of them may last, and how hard they drive the machine.
    rig
        Runs them.
    progress
        Told what is being done.
    axes
        Those that are asked about; by default all.

    Raises
    ------
    RunError
        Where the machine cannot follow, however gentle the motion.
    UsageError
        Where it is too slow to begin within that time.
    """
    machine = load(config)
    pieces = _Pieces(machine)
    recordings: list[Recording] = []
    experiments: list[Experiment] = []
    used_s, number = 0.0, 0
    reaches = _reaches(machine, motions)
    chosen = _beginning(reaches, motions)
    while True:
        number += 1
        log = folder / f"telling_{number}.parquet"
        new, motions = _run(machine, pieces, chosen, log, motions, rig, progress)
        reaches = _reaches(machine, motions)  # that may have been run more gently
        ran = replace(chosen, duration_s=chosen.candidate.lasts_s(reaches))
        recordings = [*recordings, new] if rig.goes_on else [new]
        used_s += ran.duration_s
        experiments.append(ran)
        recording = joined(recordings)
        progress("weighing what is still open", 0.0)
        diagnosis = _diagnosed(recording, machine, progress, axes)
        further = list(machine.further_effects.values())
        now = standing(diagnosis, reaches, further, axes)
        fallback = _roaming(reaches, number)
        following = next_experiment(
            now, reaches, fallback, [each.candidate for each in experiments]
        )
        ended = ""
        if now.settled:
            ended = "nothing is left that a motion within the envelope could settle"
        elif following is None:
            ended = "no motion within the envelope is expected to settle much of what is left"
        elif used_s + following.duration_s > motions.rich_s:
            ended = f"the time is used up: {used_s:.3g} of {motions.rich_s:g} s"
        if ended or following is None:
            return Telling(recording, tuple(experiments), now, motions, diagnosis, ended)
        chosen = following


def _beginning(reaches: Mapping[str, Reach], motions: Motions) -> Experiment:
    """Return what is run before anything is known; raises UsageError where it lasts too long."""
    first = probe(reaches, PROBE_SHARE * motions.rich_s)
    lasts_s = first.lasts_s(reaches)
    if lasts_s > motions.rich_s:
        raise UsageError(
            f"the shortest motion to begin with lasts {lasts_s:.3g} s, all telling ones may last "
            f"{motions.rich_s:g} s: take --motion own or rich"
        )
    return Experiment(first, lasts_s, ("what is there at all",))


def _run(
    machine: Machine,
    pieces: _Pieces,
    chosen: Experiment,
    log: Path,
    motions: Motions,
    rig: Rig,
    progress: Progress,
) -> tuple[Recording, Motions]:
    """Run a motion, more gently where the machine cannot follow; `pieces` then has it."""

    def run(gentler: Motions) -> None:
        tried = _Pieces(machine, {}, dict(pieces.start))
        if not rig.goes_on:
            tried.moves = {axis: list(moves) for axis, moves in pieces.moves.items()}
        tried.add(chosen.candidate, _reaches(machine, gentler))
        rig.run(
            tried.on(), log, None, lambda share: progress(f"{rig.verb} a telling motion", share)
        )
        pieces.moves, pieces.start = tried.moves, tried.start

    motions = gentler_until_followed(motions, run)
    return read_recording(log, gaps="keep"), motions


def _reaches(machine: Machine, motions: Motions) -> dict[str, Reach]:
    return {
        name: reach_in_envelope(machine, axis, motions.effort)
        for name, axis in machine.axes.items()
    }


def _diagnosed(
    recording: Recording, machine: Machine, progress: Progress, axes: Sequence[str] | None
) -> RecordingDiagnosis:
    models = declared_models(recording)
    models = {name: model for name, model in models.items() if axes is None or name in axes}
    inertia = declared_inertias(recording, machine, models)
    further = list(machine.further_effects.values())
    try:
        return diagnose_recording(recording, models, progress, None, further, inertia)
    except DataError as error:
        return RecordingDiagnosis(
            recording.source,
            recording.sample_rate_hz,
            recording.duration_s,
            {},
            dict.fromkeys(models, str(error)),
        )


def _roaming(reaches: Mapping[str, Reach], number: int) -> Candidate:
    """Return moves at random that were not made before."""
    strokes = {
        axis: tuple(roam(reach, ROAMING, BEGINS[k % len(BEGINS)] + GOLDEN * number))
        for k, (axis, reach) in enumerate(reaches.items())
    }
    return Candidate("roaming", "moves at random on every axis", strokes)
