"""Which motion settles most in a second, and what none within the envelope can settle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from motorctl.experiment.candidates import Candidate, candidates, kinds
from motorctl.experiment.information import Products, parted_by, products_on, products_with
from motorctl.experiment.open_questions import Open, Question
from motorctl.experiment.predicted import predicted
from motorctl.identify.diagnose.report.motion_advice import Reach
from motorctl.identify.diagnose.search.hypothesis import Hypothesis

APART_S = 1.0
"""Between the end of a recording and the motion that is weighed [s]. Any other would do that is
not negative: only effects that depend on the time see it. By convention."""
FAINT_SHARE = 0.1
"""Part of a question from which a motion is said to help to settle it. Larger keeps silent about
what it adds, smaller speaks of next to nothing. By hand."""
FEWEST_ROWS = 30
"""Rows in motion that a candidate has at least to be weighed. Fewer are all ends. By hand."""


@dataclass(frozen=True)
class Prospect:
    """What a candidate is expected to tell."""

    candidate: Candidate
    duration_s: float
    told: tuple[float, ...]
    """Of each question: log-likelihood, or by how much the standard error falls, as a logarithm."""
    shares: tuple[float, ...]
    """Of what each question still needs, 0 to 1."""
    per_row: tuple[float, ...]
    """Log-likelihood a row; of "how much" NaN."""
    weighed: bool = True
    """False where it has too few rows in motion to be."""

    @property
    def rate(self) -> float:
        """Questions settled in a second."""
        return sum(self.shares) / self.duration_s


@dataclass(frozen=True)
class Inseparable:
    """A question that no motion within the envelope settles."""

    question: Question
    why: str
    """With the numbers."""

    @property
    def words(self) -> str:
        """Say it in a sentence."""
        effects = self.question.effects
        names = f"{effects[0]} and {effects[1]}" if len(effects) > 1 else effects[0]
        return f"{names}: inseparable within this envelope: {self.why}"


@dataclass(frozen=True)
class Outlook:
    """The candidates of an axis, the most telling first."""

    open: Open
    prospects: tuple[Prospect, ...]
    inseparable: tuple[Inseparable, ...]

    @property
    def lost(self) -> frozenset[str]:
        """Questions, in words, that no motion within the envelope settles."""
        return lost_questions(self.open.questions, self.inseparable)

    @property
    def best(self) -> Prospect | None:
        """The motion to run next; None where none would settle anything."""
        first = self.prospects[0] if self.prospects else None
        return first if first is not None and first.rate > 0.0 else None


def look_out(
    known: Open,
    reaches: Mapping[str, Reach],
    tried: Sequence[Candidate] | None = None,
) -> Outlook:
    """Weigh candidates by what is open about an axis.

    Parameters
    ----------
    known
        What is open.
    reaches
        What each axis may use.
    tried
        The motions; by default all that there are for this axis.
    """
    motions = candidates(known.axis, reaches) if tried is None else list(tried)
    prospects = [_prospect(known, each, reaches) for each in motions]
    unweighed = {each.kind for each in motions} if tried is not None else kinds(known.axis, reaches)
    unweighed -= {each.candidate.kind for each in prospects if each.weighed}
    found = [
        _inseparable(question, i, prospects, all_weighed=not unweighed)
        for i, question in enumerate(known.questions)
    ]
    by_effects = {each.question.effects: each for each in reversed(found) if each is not None}
    inseparable = tuple(by_effects.values())
    lost = lost_questions(known.questions, inseparable)
    weighed = [_without(each, known.questions, lost) for each in prospects]
    ordered = sorted(weighed, key=lambda each: -each.rate)
    return Outlook(known, tuple(ordered), inseparable)


def lost_questions(
    questions: Sequence[Question], inseparable: Sequence[Inseparable]
) -> frozenset[str]:
    """Return the questions that are lost with those that cannot be settled: of the same effects."""
    return frozenset(
        question.words
        for question in questions
        for each in inseparable
        if question.effects == each.question.effects and question.kind != "how much"
    )


def what_it_settles(prospect: Prospect, questions: Sequence[Question]) -> str:
    """Say in words what a motion is expected to settle."""
    whole, parts = [], []
    pairs = zip(questions, prospect.shares, strict=True)
    for question, share in sorted(pairs, key=lambda pair: -pair[1]):
        if share >= 1.0:
            whole.append(question.words)
        elif share >= FAINT_SHARE:
            parts.append(f"{100.0 * share:.0f} % of {question.words}")
    settled = [f"settles {', '.join(whole)}"] if whole else []
    return "; ".join([*settled, *parts]) or "little of what is open"


def _without(prospect: Prospect, questions: Sequence[Question], lost: frozenset[str]) -> Prospect:
    """Count no share of a question that cannot be settled."""
    shares = tuple(
        0.0 if question.words in lost else share
        for question, share in zip(questions, prospect.shares, strict=True)
    )
    return replace(prospect, shares=shares)


def _inseparable(
    question: Question, i: int, prospects: Sequence[Prospect], *, all_weighed: bool
) -> Inseparable | None:
    """Return why a question of two names cannot be settled, or None where it can.

    Nor is it said where some kind of motion was not weighed.
    """
    if question.hopeless:
        return Inseparable(question, question.hopeless)
    # two are told apart by a part of what is left over, however long the recording is
    needed = question.needed_per_row
    if not prospects or not all_weighed or needed <= 0.0 or question.known >= question.needed:
        return None
    best = max(prospects, key=lambda each: each.per_row[i])
    if best.per_row[i] >= needed:
        return None
    return Inseparable(
        question,
        f"the best motion for it ({best.candidate.words}) is expected to tell "
        f"{best.per_row[i]:.2g} of log-likelihood a row, and {needed:.2g} is needed",
    )


def _prospect(known: Open, candidate: Candidate, reaches: Mapping[str, Reach]) -> Prospect:
    paths = candidate.trajectories(reaches)
    data = known.best.regressors.signals.data
    begin_s = float(data.time_s[-1]) + APART_S
    formed: dict[tuple[int, int], Products] = {}
    duration_s = candidate.lasts_s(reaches)
    rows = 0

    def on(hypothesis: Hypothesis, truth: Hypothesis) -> Products:
        key = id(hypothesis), id(truth)
        if key not in formed:
            formed[key] = products_on(hypothesis, seen[id(truth)], known.spans)
        return formed[key]

    seen = {}
    hopeless = {question.effects for question in known.questions if question.hopeless}
    for question in known.questions:
        for truth in question.truths if question.effects not in hopeless else ():
            if id(truth) not in seen:
                seen[id(truth)] = predicted(truth, paths, known.axis, begin_s)
                rows = seen[id(truth)].rows
                if rows < FEWEST_ROWS:
                    return _nothing(candidate, duration_s, known)
    told, shares, per_row = [], [], []
    moved = known.best.on(seen[id(known.best)]) if id(known.best) in seen else known.best
    for question in known.questions:
        gained, needed = 0.0, 1.0
        if question.effects in hopeless:
            per_row.append(0.0)
        elif question.kind == "how much":
            gained = _narrowed(known, question, on(known.best, known.best))
            needed = math.log(question.known / question.needed)
            per_row.append(math.nan)
        elif question.trace is not None:
            before = products_with(known.best, question.trace.effect)
            after = products_with(moved, question.trace.effect)
            both = [old.plus(new) for old, new in zip(before, after, strict=True)]
            gained = question.trace.shown(both, known.variance) - question.known
            needed = question.needed - question.known
            per_row.append(gained / rows)
        else:
            first, second = question.truths
            ways = [(second, first)]
            if question.kind == "which":
                ways.append((first, second))
            gained = min(
                parted_by(
                    (known.products[id(rival)], on(rival, truth)),
                    (known.products[id(truth)], on(truth, truth)),
                    known.variance,
                )
                for rival, truth in ways
            )
            needed = question.needed - question.known
            per_row.append(gained / rows)
        gained = gained if math.isfinite(gained) else 0.0
        told.append(gained)
        net = gained - question.needed_per_row * rows
        shares.append(min(max(net, 0.0) / needed, 1.0) if needed > 0.0 else 0.0)
    return Prospect(candidate, duration_s, tuple(told), tuple(shares), tuple(per_row))


def _nothing(candidate: Candidate, duration_s: float, known: Open) -> Prospect:
    """Return the prospect of a motion in which an axis all but stands."""
    zeros = tuple(0.0 for _ in known.questions)
    return Prospect(candidate, duration_s, zeros, zeros, zeros, weighed=False)


def _narrowed(known: Open, question: Question, more: Products) -> float:
    """Return by how much a standard error falls, as a logarithm."""
    before = known.products[id(known.best)]
    after = before.plus(more)
    i = question.parameter
    ratio = before.errors[i] / max(float(after.errors[i]), 1e-300)
    return max(math.log(ratio), 0.0)
