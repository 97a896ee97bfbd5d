"""Try a configuration out: run its motions, and measure what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.close_loop.motion import MotionName, Motions, machine_on
from motorctl.close_loop.rigs import Rig
from motorctl.config import Machine, load
from motorctl.errors import DataError, RunError, UsageError
from motorctl.identify.columns.measured import with_others
from motorctl.identify.compare.disturbed_rows import disturbed_rows
from motorctl.identify.compare.measures import Measures, measure_axis
from motorctl.identify.refine.model_error import force_error_rms
from motorctl.log import Recording, read_recording

GENTLER = 0.7
MOST_TRIES = 4
REPEATS_WITHIN = 0.2
"""On a machine no run is quite like the one before: what is left of an error by this part larger
counts as equal. More keeps what does harm, less drops a change of one axis for the noise of another
one that was not changed. By hand: over a bus of a busy computer errors of the same models differed
by 15 % from run to run."""

Progress = Callable[[str, float], None]
"""Told what is being done, and the share of it that is."""


@dataclass(frozen=True)
class Trial:
    """What a configuration did on its own motion and on one that no diagnosis has seen."""

    config: Path
    machine: Machine
    recordings: Mapping[MotionName, Recording]
    measures: Mapping[MotionName, Mapping[str, Measures]]
    """By motion and axis; an axis that only held its place is not among them."""
    tripped: str = ""
    """Why a run ended before its time."""
    repeats_within: float = 0.0
    """By which part an error differs from run to run though nothing was changed."""
    disturbed: float = 0.0
    """Part of the rows that count for nothing, as samples were missing, of the worst axis."""

    def without_recordings(self) -> Trial:
        """Return it without its runs' rows, which are large; what was measured stays."""
        return replace(self, recordings={})


def try_out(
    config: Path,
    folder: Path,
    names: tuple[MotionName, ...],
    motions: Motions,
    duration_s: float | None,
    rig: Rig,
    progress: Progress,
) -> Trial:
    """Run the motions, logs going into `folder`.

    duration_s ends the machine's own motion early. A run that trips makes a trial with `tripped`.
    What missing samples make of an error is none of the configuration's: such rows do not count.
    """
    machine = load(config)
    recordings: dict[MotionName, Recording] = {}
    measures: dict[MotionName, Mapping[str, Measures]] = {}
    tripped, disturbed = "", 0.0
    for name in names:
        ready = machine_on(machine, name, motions)
        log = folder / f"{name}.parquet"
        try:
            rig.run(
                ready,
                log,
                duration_s if name == "own" else None,
                lambda share, name=name: progress(f"{rig.verb} {name} motion", share),  # type: ignore[misc]
            )
        except RunError as error:
            tripped = f"{name} motion: {error}"
            break
        recordings[name] = recorded = read_recording(log, gaps="keep")
        measured = {}
        for axis in (n for n, own in ready.axes.items() if own.program is not None):
            left_out = disturbed_rows(recorded, axis)
            measured[axis] = measure_axis(recorded, axis, left_out=left_out).measures
            disturbed = max(disturbed, float(left_out.mean()))
        measures[name] = measured
    repeats_within = REPEATS_WITHIN if rig.goes_on else 0.0
    return Trial(config, machine, recordings, measures, tripped, repeats_within, disturbed)


def first_trial(
    config: Path,
    folder: Path,
    names: tuple[MotionName, ...],
    motions: Motions,
    duration_s: float | None,
    rig: Rig,
    progress: Progress,
) -> tuple[Trial, Motions]:
    """Try out the configuration that everything starts from, made motions no harder than it can.

    Raises RunError where it cannot follow its own motion.
    """
    for _ in range(MOST_TRIES):
        trial = try_out(config, folder, names, motions, duration_s, rig, progress)
        if not trial.tripped or ("own" not in trial.recordings and "own" in names):
            break
        motions = replace(motions, effort=GENTLER * motions.effort)
    if trial.tripped:
        raise RunError(f"{config}: {trial.tripped}")
    return trial, motions


def record_rich(
    config: Path, log: Path, motions: Motions, rig: Rig, progress: Progress
) -> tuple[Recording, Motions]:
    """Run the motion that shows most; more gently where the machine cannot follow."""
    machine = load(config)

    def run(tried: Motions) -> None:
        rig.run(
            machine_on(machine, "rich", tried),
            log,
            None,
            lambda share: progress(f"{rig.verb} rich motion", share),
        )

    motions = gentler_until_followed(motions, run)
    return read_recording(log, gaps="keep"), motions


def gentler_until_followed(motions: Motions, run: Callable[[Motions], None]) -> Motions:
    """Run motions, more gently where the machine cannot follow; return those that it could.

    Raises RunError where it cannot follow the gentlest.
    """
    for left in reversed(range(MOST_TRIES)):
        try:
            run(motions)
        except RunError:
            if not left:
                raise
            motions = replace(motions, effort=GENTLER * motions.effort)
        else:
            break
    return motions


def model_error_v(
    machine: Machine, recording: Recording, corrected_by: Machine
) -> dict[str, float]:
    """Return what each axis' start values leave of the command of a recording, rms.

    `corrected_by` is the machine that made the recording: the errors of the measurement that it
    declares are not in the recorded position. NaN where an axis cannot be judged.
    """
    found = {}
    for name, axis in machine.axes.items():
        applied = corrected_by.axes[name].model.names
        try:
            data = with_others(recording, name)
            found[name] = force_error_rms(data, axis.model, axis.theta_initial, applied)
        except (DataError, UsageError):
            found[name] = float("nan")
    return found
