"""What was wrong, in lines from which a case can be run again, and how confidence fared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Protocol

from motorctl_benchmarks.diagnosis.answer import Answer
from motorctl_benchmarks.diagnosis.figures import (
    AT_MOST_OVER_ORACLE,
    EXCESS_AT_LEAST_HALVED,
    HALVED,
)
from motorctl_benchmarks.diagnosis.run_case import Outcome
from motorctl_benchmarks.diagnosis.score import Truth, calibration


def mistakes(outcomes: Sequence[Outcome]) -> list[dict[str, str]]:
    """Return every wrong answer, and every refined controller that is not good enough."""
    rows = []
    for outcome in outcomes:
        if not outcome.right:
            rows.append(
                {
                    "case": str(outcome.key),
                    "truth": outcome.title,
                    "answer": str(outcome.answer),
                }
            )
        if words := _of_the_loop(outcome):
            rows.append({"case": str(outcome.key), "truth": outcome.title, "answer": words})
    return rows


def _of_the_loop(outcome: Outcome) -> str:
    if outcome.closed_loop_failure:
        return f"closed loop failed: {outcome.closed_loop_failure}"
    loop = outcome.closed_loop
    if loop is None:
        return ""
    if set(outcome.truth) & set(HALVED):
        good = EXCESS_AT_LEAST_HALVED.met_by(100.0 * loop.excess_left)
    else:
        good = AT_MOST_OVER_ORACLE.met_by(loop.over_oracle)
    if good:
        return ""
    errors = {
        "own": loop.own_m,
        "declared": loop.declared_m,
        "refined": loop.refined_m,
        "oracle": loop.oracle_m,
    }
    told = ", ".join(f"{name} {1e6 * error:.2f}" for name, error in errors.items())
    return f"closed loop, um rms: {told}; added {', '.join(loop.added) or 'nothing'}"


class Scored(Protocol):
    """A case of whichever bench, with what was put in and what was answered."""

    @property
    def truth(self) -> Truth:
        """What was put in."""

    @property
    def answer(self) -> Answer:
        """What was answered."""


def calibration_lines(outcomes: Sequence[Scored]) -> list[str]:
    """Say how often names were right, by the confidence that they were given with."""
    bins, _ = calibration([(o.truth, o.answer) for o in outcomes])
    return [
        f"confidence {b.low:g} to {b.high:g}: {b.count} names, mean {b.mean_confidence:.2f}, "
        f"right {b.share_right:.2f}"
        for b in bins
    ]


def calibration_document(outcomes: Sequence[Scored]) -> list[dict[str, Any]]:
    """Return the calibration as plain data, a mapping for each bin."""
    bins, _ = calibration([(o.truth, o.answer) for o in outcomes])
    return [asdict(b) for b in bins]
