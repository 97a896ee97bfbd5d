"""The rules by which answers are right or wrong, and how well confidence is calibrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motorctl_benchmarks.diagnosis.answer import Answer
from motorctl_benchmarks.diagnosis.plants import Options

Truth = Mapping[str, Options]
"""The simulator's options of every effect that was put in, by its name; empty: clean."""

BIN_EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)


def also_right(truth: Truth) -> frozenset[str]:
    """Return names that are no error beside the truth.

    Cogging that was drawn with an aperiodic part is a periodic force and one that is not: a
    function of position beside it names that second part.
    """
    aperiodic = "aperiodic" in truth.get("cogging", {})
    return frozenset({"position_force"}) if aperiodic else frozenset()


def _may_leave_structure(truth: Truth) -> bool:
    """Tell whether something is left once every known effect in the plant is named.

    A position force that was drawn as a cable chain with hysteresis is a function of position and
    of the way there: that a named spring leaves structure which no known effect explains is true.
    """
    return "cable" in truth.get("position_force", {})


def _named_some(truth: Truth, answer: Answer) -> bool:
    verdicts = {"effect"} | ({"unknown_structure"} if _may_leave_structure(truth) else set())
    return answer.verdict in verdicts and bool(answer.named)


def named_first(truth: Truth, answer: Answer) -> bool:
    """Tell whether the verdict is `effect` and the first name is one of those put in.

    What is named behind it does not count here; a name that the answer calls indistinguishable
    from the first does not count for it either.
    """
    return _named_some(truth, answer) and answer.named[0].name in truth


def exact_set(truth: Truth, answer: Answer) -> bool:
    """Tell whether all effects that were put in are named and no other (but see `also_right`)."""
    allowed = frozenset(truth) | also_right(truth)
    return _named_some(truth, answer) and frozenset(truth) <= answer.names <= allowed


def no_cause(_truth: Truth, answer: Answer) -> bool:
    """Tell whether no cause is named: nothing is missing, or this motion cannot tell.

    Structure that is called unknown is a false alarm as well.
    """
    return answer.verdict in ("complete", "insufficient_data") and not answer.named


def called_unknown(_truth: Truth, answer: Answer) -> bool:
    """Tell whether the verdict is `unknown_structure`, whatever is named beside it."""
    return answer.verdict == "unknown_structure"


def no_wrong_name(truth: Truth, answer: Answer) -> bool:
    """Tell whether every name is right, or is told to be indistinguishable from one that is."""
    right = frozenset(truth) | also_right(truth)
    return bool(answer.verdict != "failed") and all(n.may_be & right for n in answer.named)


def right_or_honest(truth: Truth, answer: Answer) -> bool:
    """Judge an answer on poor motion: right, or no more said than the motion shows.

    Right: the effect that was put in is named and no other. Honest: `insufficient_data` without a
    wrong name, or a name whose ambiguity contains the truth. `complete`, `unknown_structure` and
    a wrong name are neither.
    """
    if exact_set(truth, answer):
        return True
    if not no_wrong_name(truth, answer):
        return False
    if answer.verdict == "insufficient_data":
        return True
    left = frozenset(truth)
    for named in answer.named:
        left -= named.may_be
    return answer.verdict == "effect" and not left


Rule = Callable[[Truth, Answer], bool]

RULES: dict[str, Rule] = {
    "one": named_first,
    "weak": named_first,
    "clean": no_cause,
    "unknown": called_unknown,
    "several": exact_set,
    "poor": right_or_honest,
}
"""The rule of each group of cases."""


@dataclass(frozen=True)
class Bin:
    """Names given with a confidence in one range."""

    low: float
    high: float
    count: int
    mean_confidence: float
    share_right: float


def calibration(answers: Sequence[tuple[Truth, Answer]]) -> tuple[tuple[Bin, ...], float]:
    """Compare confidence with truth over every name that was given, in whatever group.

    A name is right where the effect was put in. What is returned is that of `reliability`.
    """
    given = [
        (named.confidence, named.name in frozenset(truth) | also_right(truth))
        for truth, answer in answers
        for named in answer.named
    ]
    return reliability([sure for sure, _ in given], [hit for _, hit in given])


def reliability(stated: Sequence[float], right: Sequence[bool]) -> tuple[tuple[Bin, ...], float]:
    """Compare the confidence of names, stated from 0 to 1, with which of them were right.

    Returns
    -------
    bins : tuple of Bin
        Those that have names.
    error : float
        Expected calibration error: the mean distance between confidence and share, weighted by
        names; NaN where nothing was named.
    """
    if not stated:
        return (), float("nan")
    confidence, hits = np.asarray(stated), np.asarray(right, dtype=np.float64)
    place = np.clip(np.searchsorted(BIN_EDGES, confidence, side="right") - 1, 0, len(BIN_EDGES) - 2)
    bins = tuple(
        Bin(
            BIN_EDGES[k],
            BIN_EDGES[k + 1],
            int(np.sum(place == k)),
            float(np.mean(confidence[place == k])),
            float(np.mean(hits[place == k])),
        )
        for k in np.unique(place)
    )
    error = sum(b.count * abs(b.mean_confidence - b.share_right) for b in bins) / len(confidence)
    return bins, float(error)
