"""The rounds: diagnose, refine, try out, and go on only with what makes nothing worse."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from motorctl.close_loop.judge import AxisJudgement, judge, without_gain
from motorctl.close_loop.matched_velocity import VelocityStep, match_velocity
from motorctl.close_loop.motion import MotionName, Motions, moves_by_itself
from motorctl.close_loop.rigs import ResumedRig, Rig, SimulatedRig
from motorctl.close_loop.telling import Telling, record_telling
from motorctl.close_loop.trial import Progress, Trial, first_trial, record_rich, try_out
from motorctl.config import Machine, load
from motorctl.config.learned_file import require_nothing_learned
from motorctl.errors import UsageError
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.refine.refinement import Refinement, moved_text, refine_config
from motorctl.identify.same_axis import declared_inertias
from motorctl.log import Recording

MOST_ATTEMPTS = 4
"""Within a round: each leaves out more of what was found."""
MOST_REASONS = 2
CONFIG = "config.yaml"

Motion = Literal["own", "rich", "telling"]


@dataclass(frozen=True)
class Attempt:
    """A changed configuration that was tried out."""

    folder: Path
    refinement: Refinement
    trial: Trial
    judgements: Mapping[str, AxisJudgement]

    @property
    def accepted(self) -> bool:
        """Return whether no axis became worse."""
        return all(judgement.accepted for judgement in self.judgements.values())


@dataclass(frozen=True)
class Round:
    """One time round the loop."""

    number: int
    folder: Path
    motion: Motion
    diagnosis: RecordingDiagnosis
    before: Trial
    attempts: tuple[Attempt, ...]
    """The last one may be accepted; none where there was nothing to change."""
    dropped: Mapping[str, tuple[str, ...]]
    """What was found but left out, by axis, with the reason."""
    telling: Telling | None = None
    """Which motions were chosen, where they were."""

    @property
    def accepted(self) -> Attempt | None:
        """The attempt with which the next round begins."""
        last = self.attempts[-1] if self.attempts else None
        return last if last is not None and last.accepted else None


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
        trials = [self.first, self.last, *(a.trial for r in self.rounds for a in r.attempts)]
        return max(trial.disturbed for trial in trials)

    @property
    def refined(self) -> Path:
        """The configuration that came out."""
        return self.folder / "refined.yaml"


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
    folder = _prepared(out, resume)
    start = folder / CONFIG
    start.write_text(moved_text(machine, start), encoding="utf-8", newline="")
    first, motions = first_trial(start, folder, names, motions, duration_s, rig, progress)
    rig.keep(first.machine)
    used_up = (
        "the limit of one round is reached"
        if rounds == 1
        else f"the limit of {rounds} rounds is reached"
    )
    current, done, ended = first, [], used_up
    for number in range(1, rounds + 1):
        folder = out / f"round_{number}"
        folder.mkdir(exist_ok=True)
        recording, motions, telling = _recorded(current, folder, chosen, motions, rig, progress)
        models = declared_models(recording)
        held_out = current.recordings["unused"]
        further = list(machine.further_effects.values())
        inertia = declared_inertias(recording, machine, models)
        diagnosis = diagnose_recording(recording, models, progress, held_out, further, inertia)
        attempts, dropped = _attempts(
            diagnosis, current, first, folder, names, motions, duration_s, rig, progress
        )
        done.append(Round(number, folder, chosen, diagnosis, current, attempts, dropped, telling))
        accepted = done[-1].accepted
        if accepted is None:
            ended = _why_no_further(done[-1])
            break
        current = accepted.trial
        rig.keep(current.machine)
    last = out / "matched_velocity"
    velocity = match_velocity(current, first, last, names, motions, duration_s, rig, progress)
    if velocity is not None:
        current = velocity.trial
        rig.keep(current.machine)
    refined = out / "refined.yaml"
    refined.write_text(moved_text(current.machine, refined), encoding="utf-8", newline="")
    return ClosedLoop(Path(config), out, first, current, tuple(done), ended, motions, velocity)


def _why_no_further(last: Round) -> str:
    if last.attempts:
        return "no change that was tried helps without making an error larger"
    if all(axis.verdict == "complete" for axis in last.diagnosis.axes.values()):
        return "nothing more is found"
    if any(axis.verdict == "insufficient_data" for axis in last.diagnosis.axes.values()):
        return "this motion cannot show what is still missing"
    return "nothing more is found that a controller could compensate"


def _attempts(
    diagnosis: RecordingDiagnosis,
    before: Trial,
    first: Trial,
    folder: Path,
    names: tuple[MotionName, ...],
    motions: Motions,
    duration_s: float | None,
    rig: Rig,
    progress: Progress,
) -> tuple[tuple[Attempt, ...], dict[str, tuple[str, ...]]]:
    """Try what was found; then without what seems to be the reason where an error grew."""
    attempts: list[Attempt] = []
    without: dict[str, list[str]] = {}
    kept: dict[str, str] = {}
    dropped: dict[str, tuple[str, ...]] = {}
    while len(attempts) < MOST_ATTEMPTS:
        place = folder / f"attempt_{len(attempts) + 1}"
        place.mkdir(exist_ok=True)
        refinement = refine_config(
            diagnosis, before.config, place / CONFIG, without=without, kept=kept
        )
        if not refinement.changed:
            with suppress(OSError):  # of an earlier time there may be something in it
                place.rmdir()
            break
        refinement.write()
        trial = try_out(refinement.out, place, names, motions, duration_s, rig, progress)
        judgements = {
            name: without_gain(judgement, _unnamed(diagnosis, refinement, name))
            for name, judgement in judge(before, trial, first).items()
        }
        attempts.append(Attempt(place, refinement, trial, judgements))
        if attempts[-1].accepted:
            break
        last = len(attempts) == MOST_ATTEMPTS - 1
        for axis, why in _offenders(attempts[-1]).items():
            added = refinement.axes[axis].added
            weaker = [] if last else _weaker_half(diagnosis.axes[axis], added)
            if weaker:
                without.setdefault(axis, []).extend(weaker)
            else:
                kept[axis] = f"unchanged; a change was tried and left out: {why}"
            left_out = ", ".join(weaker or added) or "new start values"
            dropped[axis] = (*dropped.get(axis, ()), f"{left_out}: {why}")
    return tuple(attempts), dropped


def _unnamed(diagnosis: RecordingDiagnosis, refinement: Refinement, axis: str) -> str:
    """Name the spline that the axis gains for what has no name; empty where it gains none."""
    if axis not in refinement.axes:
        return ""
    unknown = diagnosis.axes[axis].unknown
    spline = None if unknown is None or unknown.compensation is None else unknown.compensation.name
    return spline if spline in refinement.axes[axis].added else ""


def _offenders(attempt: Attempt) -> dict[str, str]:
    """Return the changed axes that became worse; all changed ones where only others did."""
    changed = [name for name, axis in attempt.refinement.axes.items() if axis.changed]
    against = {
        name: "; ".join(judgement.against[:MOST_REASONS])
        for name, judgement in attempt.judgements.items()
        if not judgement.accepted
    }
    own = {name: against[name] for name in changed if name in against}
    return own or dict.fromkeys(changed, "; ".join(f"{n}: {why}" for n, why in against.items()))


def _weaker_half(found: AxisDiagnosis, added: tuple[str, ...]) -> list[str]:
    """Name those of the added effects that explain less; none where there is only one."""
    scores = {effect.name: effect.score for effect in found.effects}
    # A spline that compensates what has no name goes first.
    strongest_first = sorted(added, key=lambda name: scores.get(name, -1.0), reverse=True)
    return strongest_first[-(-len(added) // 2) :]


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


def _prepared(out: Path, resume: bool) -> Path:
    """Return the folder of the start; rounds of an earlier time are removed unless it resumes."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        folder = out / "round_0"
        if (folder / CONFIG).is_file() and not resume:
            for old in out.glob("round_[0-9]*"):
                shutil.rmtree(old)
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror}") from error
    return folder
