"""Try what a diagnosis found, so that each axis keeps the best of what was tried for it.

First all axes together. Where an error grew, what did well is tried without what did not, and kept
before the rest is tried beside it: no axis' addition drags another one's back. What did well beside
the others and does not without them is tried beside less of theirs, and again when more is kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from motorctl.close_loop.blame import offenders, unnamed_spline, weaker_half
from motorctl.close_loop.judge import AxisJudgement, judge, without_gain
from motorctl.close_loop.run_folder import CONFIG
from motorctl.close_loop.trial import Trial
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.refine.refinement import Refinement, refine_config

ATTEMPTS_OF_TWO = 6
"""Within a round, of up to two axes. More move a machine for longer, fewer leave untried what may
help. By hand: two axes together, each by itself, half of what was found for each, and once more."""
ATTEMPTS_AN_AXIS = 2
"""For each further one: by itself, and half of what was found for it."""

Run = Callable[[Path, Path], Trial]
"""Tries a configuration out; the logs go into a folder."""
Chosen = frozenset[tuple[str, tuple[str, ...]]]
"""Which of the effects that were found each axis is left without."""


@dataclass(frozen=True)
class Attempt:
    """A changed configuration that was tried out."""

    folder: Path
    refinement: Refinement
    trial: Trial
    judgements: Mapping[str, AxisJudgement]
    """Errors are set beside those before the round; accepted is what is larger neither than these
    nor than those of what was kept before it."""
    tried: tuple[str, ...]
    """The axes whose change was tried in it."""
    beside: Path | None
    """The configuration that was kept before it; None where there was none yet."""

    @property
    def accepted(self) -> bool:
        """Return whether no axis became worse."""
        return all(judgement.accepted for judgement in self.judgements.values())

    def added(self, axis: str) -> tuple[str, ...]:
        """Name the effects that an axis has in it and did not have before the round."""
        refined = self.refinement.axes
        return refined[axis].added if axis in refined else ()

    def without_recordings(self) -> Attempt:
        """Return it without its runs' rows, which are large; what was measured stays."""
        return replace(self, trial=self.trial.without_recordings())


@dataclass(frozen=True)
class Proposal:
    """What is to be tried beside what is kept."""

    without: Mapping[str, tuple[str, ...]]
    """By axis, which of the effects that were found are left out; other axes stay as kept."""
    did_well: bool = False
    """Whether the same did no harm to these axes beside others' changes."""
    otherwise: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """What of these others is tried with it where it does not do well without."""


@dataclass(frozen=True)
class Attempts:
    """All attempts of a round."""

    tried: tuple[Attempt, ...]
    dropped: Mapping[str, tuple[str, ...]]
    """What was found but left out, by axis, with the reason."""
    shares: Mapping[str, AxisJudgement]
    """What the last accepted one did to each axis, beside what was before them all; or empty."""
    waiting: tuple[Proposal, ...] = ()
    """What there was no attempt left for."""
    found: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """By axis that a change was found for, all effects that it would gain."""


def most_attempts(axes: int) -> int:
    """Return how many a round makes where something was found for so many axes."""
    return ATTEMPTS_OF_TWO + ATTEMPTS_AN_AXIS * max(axes - 2, 0)


def try_found(
    diagnosis: RecordingDiagnosis,
    before: Trial,
    first: Trial,
    folder: Path,
    run: Run,
    after: Attempts | None = None,
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
    after
        Attempts at the same of which none was accepted: what waits there is tried.
    """
    search = _Search(diagnosis, before, first, folder, run)
    if after is None:
        search.waiting.append(Proposal(dict.fromkeys(diagnosis.axes, ())))
    else:
        search.waiting.extend(after.waiting)
        search.found.update(after.found)
    while (proposal := search.following()) is not None:
        if search.tried and len(search.tried) >= most_attempts(len(search.found)):
            search.waiting.appendleft(proposal)
            break
        search.attempt(proposal)
    left = tuple(iter(search.following, None))
    search.tell_of(left)
    return Attempts(
        tuple(search.tried), search.dropped(), search.shares(), left, dict(search.found)
    )


@dataclass
class _Search:
    diagnosis: RecordingDiagnosis
    before: Trial
    first: Trial
    folder: Path
    run: Run
    waiting: deque[Proposal] = field(default_factory=deque)
    tried: list[Attempt] = field(default_factory=list)
    found: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._kept: dict[str, tuple[str, ...]] = {}
        """As of a proposal, of the best so far."""
        self._best = self.before
        self._why: dict[str, str] = {}
        """Why an axis' last change was turned down."""
        self._left_out: dict[tuple[str, tuple[str, ...]], str] = {}
        """By axis and effects, why."""
        self._failed: set[Chosen] = set()
        self._turned_down: dict[Chosen, Attempt] = {}
        """What no further run would tell more of."""
        self._followed: set[tuple[Chosen, frozenset[str]]] = set()
        """With whose changes were tried in it: what follows from it waits, or was tried."""
        self._together: set[tuple[str, tuple[str, ...]]] = set()
        self._apart: set[tuple[str, tuple[str, ...]]] = set()
        self._well: set[tuple[str, tuple[str, ...]]] = set()
        """What did well beside others, and was not yet turned down without them."""
        self._again: dict[str, tuple[str, ...]] = {}
        """What was, to be tried once more when something is kept."""

    def following(self) -> Proposal | None:
        """Take what is to be tried next, if anything: what is known is passed over."""
        while self.waiting:
            proposal = self.waiting.popleft()
            new = {n: w for n, w in proposal.without.items() if not self._has(n, w)}
            if not new:
                continue
            proposal = replace(proposal, without=new)
            chosen = self._chosen(proposal)
            if (chosen, frozenset(new)) in self._followed:
                continue
            if chosen not in self._turned_down:
                return proposal
            # when others' changes, kept since, were tried with it
            self._turn_down(proposal, chosen, self._turned_down[chosen])
        return None

    def attempt(self, proposal: Proposal) -> None:
        """Try a proposal out; what follows from it is kept, or waits."""
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
        for name in changed:
            self.found.setdefault(name, refinement.axes[name].added)
        (self._together if len(changed) > 1 else self._apart).update(proposal.without.items())
        chosen = self._chosen(proposal)
        refinement.write()
        trial = self.run(refinement.out, place)
        judgements = self._judged(trial, refinement, changed)
        beside = None if self._best is self.before else self._best.config
        attempt = Attempt(place, refinement, trial, judgements, tuple(changed), beside)
        if attempt.accepted:
            self.tried = [*(earlier.without_recordings() for earlier in self.tried), attempt]
            self._keep(proposal, trial)
            return
        attempt = attempt.without_recordings()
        self.tried.append(attempt)
        # on a machine one run may be spoilt by what is none of the models'; what trips, trips again
        may_be_spoilt = trial.repeats_within and not trial.tripped and chosen not in self._failed
        self._failed.add(chosen)
        if may_be_spoilt and proposal.did_well:
            self.waiting.appendleft(replace(proposal, did_well=False))
            return
        if not may_be_spoilt:
            self._turned_down[chosen] = attempt
        self._turn_down(proposal, chosen, attempt)

    def tell_of(self, left: Collection[Proposal]) -> None:
        """Note what is left out because there were attempts enough."""
        limit = f"as a round makes {most_attempts(len(self.found))} attempts"
        for proposal in left:
            for axis, without in proposal.without.items():
                if (axis, without) in self._apart:  # which is told of
                    continue
                why = f"not tried, {limit}"
                if (axis, without) in self._together:
                    reason = f" ({self._why[axis]})" if axis in self._why else ""
                    why = f"tried only together with the others{reason}; not apart, {limit}"
                rest = [name for name in self.found.get(axis, ()) if name not in without]
                self._leave_out(axis, rest, why)

    def dropped(self) -> dict[str, tuple[str, ...]]:
        """Return what was found but is not kept, by axis, with the reason."""
        told: dict[str, tuple[str, ...]] = {}
        for (axis, effects), why in self._left_out.items():
            missing = [name for name in effects if not self._has_effect(axis, name)]
            if missing or (not effects and axis not in self._kept):
                words = f"{', '.join(missing) or 'new start values'}: {why}"
                told[axis] = (*told.get(axis, ()), words)
        return told

    def shares(self) -> Mapping[str, AxisJudgement]:
        """Return what was done to each axis in the end."""
        accepted = [attempt.judgements for attempt in self.tried if attempt.accepted]
        return accepted[-1] if accepted else {}

    def _chosen(self, proposal: Proposal) -> Chosen:
        return frozenset({**self._kept, **proposal.without}.items())

    def _has(self, axis: str, without: Collection[str]) -> bool:
        """Return whether as much of what was found for the axis is kept already."""
        return axis in self._kept and set(self._kept[axis]) <= set(without)

    def _has_effect(self, axis: str, effect: str) -> bool:
        return axis in self._kept and effect not in self._kept[axis]

    def _refined(self, place: Path, proposal: Proposal) -> Refinement:
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

    def _judged(
        self, trial: Trial, refinement: Refinement, changed: Collection[str]
    ) -> dict[str, AxisJudgement]:
        """Judge beside what is kept and what was before: small steps must not add up."""
        beside = judge(self._best, trial, self.first)
        for name in changed:
            spline = unnamed_spline(self.diagnosis.axes[name], refinement.axes[name].added)
            beside[name] = without_gain(beside[name], spline)
        if self._best is self.before:
            return beside
        whole = judge(self.before, trial, self.first)
        return {name: _as_well(whole[name], beside[name]) for name in whole}

    def _keep(self, proposal: Proposal, trial: Trial) -> None:
        self._kept |= proposal.without
        self._best = trial
        if self._again:
            self.waiting.appendleft(Proposal(self._again))
            self._again = {}

    def _turn_down(self, proposal: Proposal, chosen: Chosen, attempt: Attempt) -> None:
        self._followed.add((chosen, frozenset(proposal.without)))
        against = offenders(proposal.without, attempt.judgements)
        self._why |= against
        for item in proposal.without.items():
            if item in self._well and item[0] in against:
                self._well.remove(item)
                self._again |= [item]
        if proposal.otherwise:
            self.waiting.appendleft(Proposal({**proposal.without, **proposal.otherwise}))
        self.waiting.extend(self._followers(proposal, against, attempt))

    def _followers(
        self, proposal: Proposal, against: Mapping[str, str], attempt: Attempt
    ) -> Iterator[Proposal]:
        """Yield what is to be tried after a proposal that made an error larger."""
        weaker = {n: weaker_half(self.diagnosis.axes[n], attempt.added(n)) for n in against}
        less = {n: (*proposal.without[n], *half) for n, half in weaker.items() if half}
        if len(proposal.without) > 1:
            good = {n: without for n, without in proposal.without.items() if n not in against}
            self._well.update(good.items())
            if good:
                yield Proposal(good, did_well=True, otherwise=less)
            for axis in against:  # another one may have dragged it back
                yield Proposal({axis: proposal.without[axis]})
            if not good and len(less) > 1:  # or each needs the other
                yield Proposal(less)
            return
        ((axis, why),) = against.items()
        self._leave_out(axis, weaker[axis] or attempt.added(axis), why)
        if less:
            yield Proposal(less)

    def _leave_out(self, axis: str, effects: Collection[str], why: str) -> None:
        self._left_out[axis, tuple(effects)] = why


def _as_well(whole: AxisJudgement, beside: AxisJudgement) -> AxisJudgement:
    """Return what was done since the round began, accepted only where `beside` is, too."""
    against = beside.against or tuple(f"since the round began, {why}" for why in whole.against)
    return replace(whole, accepted=not against, against=against)
