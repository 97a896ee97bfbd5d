"""Try what a diagnosis found, so that each axis keeps the best of what was tried for it.

First all axes together. Where an error grew, what did well is tried without what did not, and kept
before the rest is tried beside it: no axis' addition drags another one's back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from motorctl.close_loop.judge import AxisJudgement, judge, without_gain
from motorctl.close_loop.run_folder import CONFIG
from motorctl.close_loop.trial import Trial
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.identify.refine.refinement import Refinement, refine_config

MOST_ATTEMPTS = 6
"""Within a round. More move a machine for longer, fewer leave untried what may help. By hand: two
axes together, each by itself, half of what was found for each, and once more."""
MOST_REASONS = 2

Run = Callable[[Path, Path], Trial]
"""Tries a configuration out; the logs go into a folder."""


@dataclass(frozen=True)
class Attempt:
    """A changed configuration that was tried out."""

    folder: Path
    refinement: Refinement
    trial: Trial
    judgements: Mapping[str, AxisJudgement]
    """Beside what was kept before it."""

    @property
    def accepted(self) -> bool:
        """Return whether no axis became worse."""
        return all(judgement.accepted for judgement in self.judgements.values())

    def added(self, axis: str) -> tuple[str, ...]:
        """Name the effects that an axis has in it and did not have before the round."""
        refined = self.refinement.axes
        return refined[axis].added if axis in refined else ()


@dataclass(frozen=True)
class Attempts:
    """All attempts of a round."""

    tried: tuple[Attempt, ...]
    dropped: Mapping[str, tuple[str, ...]]
    """What was found but left out, by axis, with the reason."""
    shares: Mapping[str, AxisJudgement]
    """What the last accepted one did to each axis, beside what was before them all; or empty."""


@dataclass(frozen=True)
class _Proposal:
    """What is to be tried beside what is kept."""

    without: Mapping[str, tuple[str, ...]]
    """By axis, which of the effects that were found are left out; other axes stay as kept."""
    did_well: bool = False
    """Whether the same did no harm to these axes beside others' changes."""


def try_found(
    diagnosis: RecordingDiagnosis, before: Trial, first: Trial, folder: Path, run: Run
) -> Attempts:
    """Try what was found, and go on without what seems to be the reason where an error grew.

    Parameters
    ----------
    diagnosis
        What was found.
    before
        The configuration that is changed, tried out.
    first
        That from which all rounds started.
    folder
        Where each attempt gets a folder.
    run
        Tries a configuration out.
    """
    search = _Search(diagnosis, before, first, folder, run)
    while search.waiting and len(search.tried) < MOST_ATTEMPTS:
        search.attempt(search.waiting.popleft())
    search.tell_of_what_waits()
    return Attempts(tuple(search.tried), search.dropped, search.shares())


@dataclass
class _Search:
    diagnosis: RecordingDiagnosis
    before: Trial
    first: Trial
    folder: Path
    run: Run
    waiting: deque[_Proposal] = field(default_factory=deque)
    tried: list[Attempt] = field(default_factory=list)
    dropped: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._kept: dict[str, tuple[str, ...]] = {}
        """As of a proposal, of the best so far."""
        self._best = self.before
        self._why: dict[str, str] = {}
        """Why an axis' last change was turned down."""
        self._turned_down: dict[frozenset[tuple[str, tuple[str, ...]]], Attempt] = {}
        """By what each axis had."""
        self.waiting.append(_Proposal(dict.fromkeys(self.diagnosis.axes, ())))

    def attempt(self, proposal: _Proposal) -> None:
        """Try a proposal out; what follows from it is kept, or waits."""
        chosen = frozenset({**self._kept, **proposal.without}.items())
        if chosen in self._turned_down:  # when others' changes, kept since, were tried with it
            self.waiting.extend(self._followers(proposal, self._turned_down[chosen]))
            return
        place = self.folder / f"attempt_{len(self.tried) + 1}"
        place.mkdir(exist_ok=True)
        refinement = self._refined(place, proposal)
        changed = [name for name in proposal.without if refinement.axes[name].changed]
        # those without a change say themselves why they have none
        self._kept |= {n: own for n, own in proposal.without.items() if n not in changed}
        if not changed:
            with suppress(OSError):  # of an earlier time there may be something in it
                place.rmdir()
            return
        proposal = replace(proposal, without={n: proposal.without[n] for n in changed})
        refinement.write()
        trial = self.run(refinement.out, place)
        judgements = judge(self._best, trial, self.first)
        for name in changed:
            spline = _unnamed(self.diagnosis.axes[name], refinement.axes[name].added)
            judgements[name] = without_gain(judgements[name], spline)
        attempt = Attempt(place, refinement, trial, judgements)
        self.tried.append(attempt)
        if attempt.accepted:
            self._kept |= proposal.without
            self._best = trial
        elif proposal.did_well and trial.repeats_within:
            # on a machine one run may be spoilt by what is none of the models'
            self.waiting.appendleft(replace(proposal, did_well=False))
        else:
            self._turned_down[chosen] = attempt
            self.waiting.extend(self._followers(proposal, attempt))

    def tell_of_what_waits(self) -> None:
        """Note what is left out because there were attempts enough."""
        for proposal in self.waiting:
            for axis, without in proposal.without.items():
                added = self.tried[0].refinement.axes[axis].added
                rest = [name for name in added if name not in without]
                self._drop(axis, rest, f"not tried, for a round makes {MOST_ATTEMPTS} attempts")

    def shares(self) -> Mapping[str, AxisJudgement]:
        """Return what was done to each axis in the end."""
        if self._best is self.before:
            return {}
        if self.tried[0].accepted:
            return self.tried[0].judgements
        return judge(self.before, self._best, self.first)

    def _refined(self, place: Path, proposal: _Proposal) -> Refinement:
        chosen = {**self._kept, **proposal.without}
        left = {
            name: f"unchanged; a change was tried and left out: {self._why[name]}"
            if name in self._why
            else "unchanged: what was found for it was tried apart"
            for name in self.diagnosis.axes
            if name not in chosen
        }
        return refine_config(
            self.diagnosis, self.before.config, place / CONFIG, without=chosen, kept=left
        )

    def _followers(self, proposal: _Proposal, attempt: Attempt) -> Iterator[_Proposal]:
        """Yield what is to be tried after a proposal that made an error larger."""
        against = _offenders(proposal.without, attempt.judgements)
        self._why |= against
        if len(proposal.without) > 1:
            good = {n: without for n, without in proposal.without.items() if n not in against}
            if good:
                yield _Proposal(good, did_well=True)
            for axis in against:  # another one may have dragged it back
                yield _Proposal({axis: proposal.without[axis]})
            return
        ((axis, without),) = proposal.without.items()
        added = attempt.added(axis)
        weaker = _weaker_half(self.diagnosis.axes[axis], added)
        self._drop(axis, weaker or added, against[axis])
        if weaker:
            yield _Proposal({axis: (*without, *weaker)})

    def _drop(self, axis: str, effects: Collection[str], why: str) -> None:
        left_out = ", ".join(effects) or "new start values"
        self.dropped[axis] = (*self.dropped.get(axis, ()), f"{left_out}: {why}")


def _unnamed(found: AxisDiagnosis, added: Collection[str]) -> str:
    """Name the spline that an axis gains for what has no name; empty where it gains none."""
    unknown = found.unknown
    spline = None if unknown is None or unknown.compensation is None else unknown.compensation.name
    return spline if spline is not None and spline in added else ""


def _offenders(changed: Collection[str], judgements: Mapping[str, AxisJudgement]) -> dict[str, str]:
    """Return the changed axes that became worse; all changed ones where only others did."""
    against = {
        name: "; ".join(judgement.against[:MOST_REASONS])
        for name, judgement in judgements.items()
        if not judgement.accepted
    }
    own = {name: against[name] for name in changed if name in against}
    return own or dict.fromkeys(changed, "; ".join(f"{n}: {why}" for n, why in against.items()))


def _weaker_half(found: AxisDiagnosis, added: Collection[str]) -> list[str]:
    """Name those of the added effects that explain less; none where there is only one."""
    scores = {effect.name: effect.score for effect in found.effects}
    # A spline that compensates what has no name goes first.
    strongest_first = sorted(added, key=lambda name: scores.get(name, -1.0), reverse=True)
    return strongest_first[-(-len(added) // 2) :]
