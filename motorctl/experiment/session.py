"""What is run next on all axes at once, and whether anything is left to be settled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from motorctl.errors import DataError
from motorctl.experiment.candidates import Candidate
from motorctl.experiment.open_questions import Question, is_sure, open_questions
from motorctl.experiment.outlook import Inseparable, Outlook, Prospect, look_out, what_it_settles
from motorctl.identify.diagnose.report.motion_advice import Reach, Stroke
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.model import Effect, known_effects

ENOUGH_S = 2.0
"""Motions are put together until they last so long [s]. Larger moves for answers that the first of
them may already give, smaller diagnoses, and asks a person, more often. By hand."""
MOST_S = 5.0
"""What is put together lasts no longer [s]; by hand, as the longest single motion."""
LEAST_SHARE = 0.1
"""Part of a question that a motion has to settle to be worth its time. Larger gives up too soon,
smaller moves for next to nothing. By hand."""


@dataclass(frozen=True)
class Standing:
    """What is known of each axis, and what could be run next."""

    outlooks: Mapping[str, Outlook]
    """Of each axis that could be weighed."""
    unsure: tuple[str, ...]
    """Axes with a name or a verdict that is open and could be settled."""

    @property
    def inseparable(self) -> tuple[Inseparable, ...]:
        """Every question that no motion within the envelope settles."""
        return tuple(each for look in self.outlooks.values() for each in look.inseparable)

    @property
    def open_words(self) -> tuple[str, ...]:
        """What a motion could still settle, in words."""
        return tuple(
            f"{name}: {question.words}"
            for name, look in self.outlooks.items()
            for question in look.open.questions
            if question.words not in look.lost
        )

    @property
    def settled(self) -> bool:
        """Whether nothing is left that a motion could settle."""
        return not self.open_words and not self.unsure


@dataclass(frozen=True)
class Experiment:
    """A motion that was chosen, and why."""

    candidate: Candidate
    duration_s: float
    settles: tuple[str, ...]
    """What it was expected to settle of each axis, in words."""


def standing(
    diagnosis: RecordingDiagnosis,
    reaches: Mapping[str, Reach],
    further: Sequence[type[Effect]] = (),
    axes: Sequence[str] | None = None,
) -> Standing:
    """Weigh what could be run next for each axis that is not settled.

    Parameters
    ----------
    diagnosis
        Of everything that was recorded so far.
    reaches
        What each axis may use.
    further
        Effects that were tried beside the known ones.
    axes
        Those that are asked about; by default all.
    """
    catalogue = {**known_effects(), **{cls.name: cls for cls in further}}
    outlooks: dict[str, Outlook] = {}
    unsure: list[str] = []
    for name in axes or reaches:
        axis = diagnosis.axes.get(name)
        if axis is None:
            unsure.append(name)
            continue
        try:
            outlooks[name] = look_out(open_questions(axis, catalogue), reaches)
        except DataError:
            unsure.append(name)
            continue
        lost = {name for each in outlooks[name].inseparable for name in each.question.effects}
        if not is_sure(axis, lost):
            unsure.append(name)
    return Standing(outlooks, tuple(unsure))


def next_experiment(
    standing: Standing,
    reaches: Mapping[str, Reach],
    fallback: Candidate,
    before: Sequence[Candidate] = (),
) -> Experiment | None:
    """Choose motions that settle most in a second, one after the other, for a few seconds.

    The axis with the most to gain chooses first; the others move meanwhile, unless that one asks
    what their motion does to it. None where every name is settled, and no motion is expected to
    settle a good part of anything else.

    Parameters
    ----------
    standing
        What is open.
    reaches
        What each axis may use.
    fallback
        What is run where names are open and no motion is expected to settle them.
    before
        What was run so far: what has not settled a question then is expected to do less now.
    """
    run = [words for each in before for words in each.words.split("; ")]
    plans = [_plan(look, run) for look in standing.outlooks.values()]
    plans = sorted((plan for plan in plans if plan.pieces), key=lambda plan: -plan.rate)
    if not plans and not standing.unsure:
        return None
    if not plans:
        return Experiment(fallback, fallback.lasts_s(reaches), ("what is not named yet",))
    first, *others = plans
    beside = [] if first.moves_others else [each for each in others if not each.moves_others]
    strokes: dict[str, tuple[Stroke, ...]] = {}
    for plan in (first, *beside):
        for axis in sorted({axis for piece in plan.pieces for axis in piece.candidate.strokes}):
            strokes[axis] = plan.strokes(axis)
    together = (first, *beside)
    words = "; ".join(piece.candidate.words for plan in together for piece in plan.pieces)
    candidate = Candidate(first.pieces[0].candidate.kind, words, strokes)
    settles = tuple(f"{plan.axis}: {plan.words}" for plan in together)
    return Experiment(candidate, candidate.lasts_s(reaches), settles)


@dataclass(frozen=True)
class _Plan:
    """Motions that one axis asks for, one after the other."""

    axis: str
    questions: tuple[Question, ...]
    pieces: tuple[Prospect, ...]
    shares: tuple[float, ...]
    """Of each question, by all of them together."""

    @property
    def rate(self) -> float:
        """Questions settled in a second."""
        return sum(self.shares) / sum(piece.duration_s for piece in self.pieces)

    @property
    def moves_others(self) -> bool:
        """Whether other axes move for it."""
        return any(set(piece.candidate.strokes) != {self.axis} for piece in self.pieces)

    @property
    def words(self) -> str:
        """What all of them are expected to settle."""
        whole = replace(self.pieces[0], shares=self.shares)
        return what_it_settles(whole, self.questions)

    def strokes(self, axis: str) -> tuple[Stroke, ...]:
        """Return what an axis does in all pieces."""
        return tuple(s for piece in self.pieces for s in piece.candidate.strokes.get(axis, ()))


def _plan(look: Outlook, run: Sequence[str]) -> _Plan:
    """Take one motion after the other, each by what it adds in a second to those before."""
    shares = tuple(0.0 for _ in look.open.questions)
    pieces: list[Prospect] = []
    lasts_s = 0.0

    def added(prospect: Prospect) -> float:
        more = sum(min(s + t, 1.0) - s for s, t in zip(shares, prospect.shares, strict=True))
        return more / (1 + run.count(prospect.candidate.words))

    while lasts_s < ENOUGH_S:
        left = [each for each in look.prospects if each not in pieces]
        left = [each for each in left if not pieces or lasts_s + each.duration_s <= MOST_S]
        if pieces:  # what an axis does while others move is not timed to what comes after
            alike = set(pieces[0].candidate.strokes)
            left = [each for each in left if set(each.candidate.strokes) == alike]
            left = left if alike == {look.open.axis} else []
        best = max(left, key=lambda each: added(each) / each.duration_s, default=None)
        if best is None or added(best) < LEAST_SHARE:
            break
        pieces.append(best)
        lasts_s += best.duration_s
        shares = tuple(min(s + t, 1.0) for s, t in zip(shares, best.shares, strict=True))
    return _Plan(look.open.axis, look.open.questions, tuple(pieces), shares)
