"""Figures of the diagnosis on machines of other hands, their targets, and what else is told."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from motorctl.latency.figure import Figure, Target
from motorctl_benchmarks.diagnosis.answer import Named
from motorctl_benchmarks.diagnosis.figures import PERCENT, percent
from motorctl_benchmarks.diagnosis.score import calibration
from motorctl_benchmarks.other_machines.run_machine import MachineOutcome
from motorctl_benchmarks.other_machines.truth import Group

CASES = "cases"
CONFIDENT = 0.9
"""Names given with more are relied upon."""
NAMED_OR_FAMILY = Target("value", ">=", 97.0)
UNKNOWN_OR_FAMILY = Target("value", ">=", 90.0)
NOTHING_NAMED = Target("value", ">=", 100.0)
CASES_FALSELY_CONFIDENT = Target("value", "<=", 1.0)
TOLD = Target("value", ">=", 95.0)
NONE_WRONG = Target("value", "<=", 0.0)
NO_CRASH = Target("value", "<=", 0.0)


def machine_figures(outcomes: Sequence[MachineOutcome]) -> list[Figure]:
    """Return every figure; groups without machines are left out."""
    every, mistakes = outcomes, _of_group(outcomes, "mistake")
    outcomes = [outcome for outcome in outcomes if outcome.kind.group != "mistake"]
    figures = [
        *_known_figures(_of_group(outcomes, "known")),
        *_outside_figures(_of_group(outcomes, "outside")),
        *_clean_figures(_of_group(outcomes, "clean")),
    ]
    if outcomes:
        figures += _false_figures(outcomes)
    figures += _mistake_figures(mistakes)
    for result, target, asked in (("refused", None, outcomes), ("crashed", NO_CRASH, every)):
        count = sum(o.result == result for o in asked)
        figures.append(Figure(result, f"{result} (of {len(asked)})", count, CASES, target=target))
    _, error = calibration([(o.truth, o.answer) for o in outcomes])
    title = "confidence: calibration error"
    return [*figures, Figure("calibration_error", title, 100.0 * error, PERCENT)]


def _of_group(outcomes: Sequence[MachineOutcome], group: Group) -> list[MachineOutcome]:
    return [outcome for outcome in outcomes if outcome.kind.group == group]


def _known_figures(cases: Sequence[MachineOutcome]) -> list[Figure]:
    if not cases:
        return []
    title = f"known effects: {{}} (of {len(cases)})"
    right = percent(case.right for case in cases)
    exact = percent(case.kind.exactly_named(case.answer) for case in cases)
    return [
        Figure("known", title.format("named or family"), right, PERCENT, target=NAMED_OR_FAMILY),
        Figure("known_exact", title.format("exactly named"), exact, PERCENT),
    ]


def _outside_figures(cases: Sequence[MachineOutcome]) -> list[Figure]:
    if not cases:
        return []
    title = f"effect outside the list: called unknown, or its family (of {len(cases)})"
    right = percent(case.right for case in cases)
    return [Figure("outside", title, right, PERCENT, target=UNKNOWN_OR_FAMILY)]


def _clean_figures(cases: Sequence[MachineOutcome]) -> list[Figure]:
    if not cases:
        return []
    title = f"clean machines: {{}} (of {len(cases)})"
    silent = percent(not case.answer.names for case in cases)
    right = percent(case.right for case in cases)
    said = "complete or insufficient data"
    return [
        Figure("clean", title.format("nothing named"), silent, PERCENT, target=NOTHING_NAMED),
        Figure("clean_said", title.format(said), right, PERCENT),
    ]


def _mistake_figures(cases: Sequence[MachineOutcome]) -> list[Figure]:
    if not cases:
        return []
    title = f"mistakes of the recording: {{}} (of {len(cases)})"
    right = percent(case.right for case in cases)
    wrong = percent(not case.right and case.misleads for case in cases)
    return [
        Figure("mistakes_told", title.format("told"), right, PERCENT, target=TOLD),
        Figure(
            "mistakes_misled",
            title.format("another told, or an effect named for it"),
            wrong,
            PERCENT,
            target=NONE_WRONG,
        ),
    ]


def _false_figures(outcomes: Sequence[MachineOutcome]) -> list[Figure]:
    given = [(o, named) for o in outcomes for named in relied_upon(o)]
    names = percent(named.name in o.false_names for o, named in given)
    cases = percent(any(n.name in o.false_names for n in relied_upon(o)) for o in outcomes)
    title = f"false names above {CONFIDENT:g}: of {{}} {{}}"
    return [
        Figure("false_names", title.format(len(given), "such names"), names, PERCENT),
        Figure(
            "false_cases",
            title.format(len(outcomes), CASES),
            cases,
            PERCENT,
            target=CASES_FALSELY_CONFIDENT,
        ),
    ]


def relied_upon(outcome: MachineOutcome) -> list[Named]:
    """Return the names that were given with confidence."""
    return [named for named in outcome.answer.named if named.confidence > CONFIDENT]


def lines_by_generator(outcomes: Sequence[MachineOutcome]) -> list[str]:
    """Say of each generator what all the figures say of all of them."""
    lines = []
    for name in dict.fromkeys(outcome.key.generator for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.key.generator == name]
        parts = [
            f"{figure.title}: {figure.value:.3g}{' %' if figure.unit == PERCENT else ''}"
            for figure in machine_figures(own)
            if not math.isnan(figure.value)
        ]
        lines.append(f"{name}: {'; '.join(parts)}")
    return lines


def judgements(outcomes: Sequence[MachineOutcome]) -> dict[str, dict[str, int]]:
    """Return how often each kind was judged how."""
    table: dict[str, Counter[str]] = {}
    for outcome in outcomes:
        table.setdefault(outcome.key.kind, Counter())[outcome.judged] += 1
    return {kind: dict(counts) for kind, counts in table.items()}
