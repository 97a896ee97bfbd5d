"""The rounds: diagnose, refine, try out, and go on only with what makes nothing worse."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Literal

from motorctl.close_loop.attempts import Attempt, Attempts, try_found
from motorctl.close_loop.judge import AxisJudgement, judge
from motorctl.close_loop.matched_velocity import VelocityStep, match_velocity
from motorctl.close_loop.motion import MotionName, Motions, moves_by_itself
from motorctl.close_loop.rigs import ResumedRig, Rig, SimulatedRig
from motorctl.close_loop.run_folder import CONFIG, MATCHED, REFINED, prepared
from motorctl.close_loop.telling import Telling, record_telling
from motorctl.close_loop.trial import Progress, Trial, first_trial, record_rich, try_out
from motorctl.config import Machine, load
from motorctl.config.learned_file import require_nothing_learned
from motorctl.errors import UsageError
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.refine.refinement import moved_text
from motorctl.identify.same_axis import declared_inertias
from motorctl.log import Recording

Motion = Literal["own", "rich", "telling"]


@dataclass(frozen=True)
class Round:
    """One time round the loop."""

    number: int
    folder: Path
    motion: Motion
    diagnosis: RecordingDiagnosis
    before: Trial
    attempts: Attempts
    """With none tried where there was nothing to change."""
    telling: Telling | None = None
    """Which motions were chosen, where they were."""

    @property
    def accepted(self) -> Attempt | None:
        """The attempt with which the next round begins."""
        kept = (attempt for attempt in reversed(self.attempts.tried) if attempt.accepted)
        return next(kept, None)

    def added(self, axis: str) -> tuple[str, ...]:
        """Name the effects that an axis has gained in it."""
        return () if self.accepted is None else self.accepted.added(axis)

    def without_recordings(self) -> Round:
        """Return it without its attempts' rows, which are large; what was measured stays."""
        tried = tuple(attempt.without_recordings() for attempt in self.attempts.tried)
        attempts = replace(self.attempts, tried=tried)
        return replace(self, before=self.before.without_recordings(), attempts=attempts)


@dataclass(frozen=True)
class ClosedLoop:
    """All rounds."""

    config: Path
    folder: Path
    first: Trial
    last: Trial
    rounds: tuple[Round, ...]
    ended: str
    """Why there was no further round."""
    motions: Motions
    velocity: VelocityStep | None = None
    """What matching the published velocity did after them; None where it was matched."""

    @cached_property
    def overall(self) -> Mapping[str, AxisJudgement]:
        """Compare the last configuration with the first, axis by axis."""
        return judge(self.first, self.last, self.first)

    @property
    def by_effects(self) -> Trial:
        """What came out of the rounds alone."""
        accepted = [part.accepted.trial for part in self.rounds if part.accepted is not None]
        return accepted[-1] if accepted else self.first

    @property
    def disturbed(self) -> float:
        """The largest part of a motion's rows that count for nothing, as samples were missing."""
        trials = [self.first, self.last, *(a.trial for r in self.rounds for a in r.attempts.tried)]
        return max(trial.disturbed for trial in trials)

    @property
    def refined(self) -> Path:
        """The configuration that came out."""
        return self.folder / REFINED


def close_loop(
    config: str | Path,
    out: Path,
    *,
    rounds: int = 3,
    motion: Motion | None = None,
    duration_s: float | None = None,
    rig: Rig | None = None,
    resume: bool = False,
    progress: Progress,
) -> ClosedLoop:
    """Go round until nothing more is found, no change helps, or the rounds are over.

    Everything is kept in `out`: a folder for each round with its log, report and configurations,
    and refined.yaml, the configuration that came out. `motion` is what is recorded for diagnosis:
    the machine's own, a rich one made within its limits, or telling ones, each chosen by what is
    still open; by default rich, for one move back and
    forth ties position, velocity, time and command together, and what looks alike is mistaken.
    duration_s is the length of each run, rig what runs it: by default virtual time. With `resume`
    what `out` holds of an earlier time is not run again. Raises UsageError where the rig cannot run
    the machine, RunError where the machine cannot follow its own motion as it is.
    """
    machine = load(config)
    rig = rig or SimulatedRig()
    _require_rig(rig, machine, config)
    require_nothing_learned(machine)
    rig = ResumedRig(rig, reuse=resume)
    own = bool(machine.followed_programs)
    chosen: Motion = motion or "rich"
    if chosen == "own" and not moves_by_itself(machine):
        still = [name for name, axis in machine.axes.items() if axis.program is None]
        raise UsageError(
            f"{machine.source}: --motion own: no program for axis {', '.join(still)} to follow; "
            "name one in the configuration, or choose another motion"
        )
    names: tuple[MotionName, ...] = ("own", "unused") if own else ("unused",)
    motions = Motions() if duration_s is None else Motions(duration_s, duration_s)
    folder = prepared(out, machine.source, resume)
    start = folder / CONFIG
    start.write_text(moved_text(machine, start), encoding="utf-8", newline="")
    first, motions = first_trial(start, folder, names, motions, duration_s, rig, progress)
    rig.keep(first.machine)
    used_up = (
        "the limit of one round is reached"
        if rounds == 1
        else f"the limit of {rounds} rounds is reached"
    )
    current, ended = first, used_up
    done: list[Round] = []
    for number in range(1, rounds + 1):
        folder = out / f"round_{number}"
        folder.mkdir(exist_ok=True)
        earlier = done[-1] if done and done[-1].accepted is None else None
        telling = None
        if earlier is not None:
            diagnosis = earlier.diagnosis
        else:
            recording, motions, telling = _recorded(current, folder, chosen, motions, rig, progress)
            models = declared_models(recording)
            held_out = current.recordings["unused"]
            further = list(machine.further_effects.values())
            inertia = declared_inertias(recording, machine, models)
            diagnosis = diagnose_recording(recording, models, progress, held_out, further, inertia)
        run = partial(
            try_out, names=names, motions=motions, duration_s=duration_s, rig=rig, progress=progress
        )
        after = None if earlier is None else earlier.attempts
        attempts = try_found(diagnosis, current, first, folder, run, after)
        done.append(Round(number, folder, chosen, diagnosis, current, attempts, telling))
        accepted = done[-1].accepted
        if accepted is not None:
            current = accepted.trial
            earlier_rounds = (part.without_recordings() for part in done[:-1])
            before = done[-1].before.without_recordings()
            done = [*earlier_rounds, replace(done[-1], before=before)]
            rig.keep(current.machine)
        elif not attempts.waiting:  # else the next round tries that: nothing else has changed
            ended = _why_no_further(done[-1])
            break
    last = out / MATCHED
    velocity = match_velocity(current, first, last, names, motions, duration_s, rig, progress)
    if velocity is not None:
        current = velocity.trial
        rig.keep(current.machine)
    refined = out / REFINED
    refined.write_text(moved_text(current.machine, refined), encoding="utf-8", newline="")
    return ClosedLoop(Path(config), out, first, current, tuple(done), ended, motions, velocity)


def _why_no_further(last: Round) -> str:
    if last.attempts.tried:
        return "no change that was tried helps without making an error larger"
    if all(axis.verdict == "complete" for axis in last.diagnosis.axes.values()):
        return "nothing more is found"
    if any(axis.verdict == "insufficient_data" for axis in last.diagnosis.axes.values()):
        return "this motion cannot show what is still missing"
    return "nothing more is found that a controller could compensate"


def _recorded(
    current: Trial, folder: Path, motion: Motion, motions: Motions, rig: Rig, progress: Progress
) -> tuple[Recording, Motions, Telling | None]:
    """Return the recording that is diagnosed."""
    if motion == "own":  # was simulated to try the configuration out
        return current.recordings["own"], motions, None
    if motion == "telling":
        telling = record_telling(current.config, folder, motions, rig, progress)
        return telling.recording, telling.motions, telling
    log = folder / "rich.parquet"
    return (*record_rich(current.config, log, motions, rig, progress), None)


def _require_rig(rig: Rig, machine: Machine, config: str | Path) -> None:
    try:
        rig.insist(machine)
    except UsageError as error:
        if not isinstance(rig, SimulatedRig):
            raise
        name = shlex.quote(str(config))
        raise UsageError(
            f"{error}, so the loop cannot be closed by simulation. On the machine, while its "
            f"daemon runs: motorctl close-loop {name} --socket SOCKET"
        ) from error
