"""What is run next on all axes at once, and whether anything is left to be settled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from motorctl.errors import DataError
from motorctl.experiment.candidates import Candidate
from motorctl.experiment.open_questions import is_sure, open_questions
from motorctl.experiment.outlook import Inseparable, Outlook, Prospect, look_out, what_it_settles
from motorctl.identify.diagnose.report.motion_advice import Reach
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.model import Effect, known_effects


@dataclass(frozen=True)
class Standing:
    """What is known of each axis, and what could be run next."""

    outlooks: Mapping[str, Outlook]
    """Of each axis that could be weighed."""
    unsure: tuple[str, ...]
    """Axes with a name or a verdict that is open, whatever could be run."""

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
        if not is_sure(axis) and not outlooks[name].open.questions:
            unsure.append(name)
    return Standing(outlooks, tuple(unsure))


def next_experiment(
    standing: Standing,
    reaches: Mapping[str, Reach],
    fallback: Candidate,
    before: Sequence[Candidate] = (),
) -> Experiment:
    """Choose the motion that settles most in a second; axes that may move beside it do so too.

    Parameters
    ----------
    standing
        What is open.
    reaches
        What each axis may use.
    fallback
        What is run where no motion is expected to settle anything.
    before
        What was run so far: what has not settled a question then is expected to do less now.
    """
    bests: list[tuple[Prospect, Outlook]] = []
    run = [words for each in before for words in each.words.split("; ")]

    def worth(prospect: Prospect) -> float:
        return prospect.rate / (1 + run.count(prospect.candidate.words))

    for look in standing.outlooks.values():
        best = max(look.prospects, key=worth, default=None)
        if best is not None and best.rate > 0.0:
            bests.append((best, look))
    bests.sort(key=lambda pair: -worth(pair[0]))
    if not bests:
        return Experiment(fallback, fallback.lasts_s(reaches), ("what is not named yet",))
    first, look = bests[0]
    strokes = dict(first.candidate.strokes)
    settles = [f"{look.open.axis}: {what_it_settles(first, look.open.questions)}"]
    words = [first.candidate.words]
    alone = look.open.axis not in strokes or len(strokes) > 1
    for prospect, other in bests[1:]:
        if alone or set(prospect.candidate.strokes) != {other.open.axis}:
            continue
        strokes |= prospect.candidate.strokes
        settles.append(f"{other.open.axis}: {what_it_settles(prospect, other.open.questions)}")
        words.append(prospect.candidate.words)
    candidate = Candidate(first.candidate.kind, "; ".join(words), strokes)
    return Experiment(candidate, candidate.lasts_s(reaches), tuple(settles))
