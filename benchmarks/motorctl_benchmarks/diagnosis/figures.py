"""The campaign's figures: shares of right answers with their targets, beside the peers' shares."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from motorctl.latency.figure import Figure, Target
from motorctl_benchmarks.diagnosis.groups import GROUPS
from motorctl_benchmarks.diagnosis.peers import LIBRARIES, MODULES, PeerAnswer, peer_name
from motorctl_benchmarks.diagnosis.run_case import Outcome
from motorctl_benchmarks.diagnosis.score import RULES, Truth, also_right, calibration, no_wrong_name

PERCENT = "%"

TARGETS = {
    "one": Target("value", ">=", 97.0),
    "weak": Target("value", ">=", 90.0),
    "clean": Target("value", ">=", 100.0),
    "unknown": Target("value", ">=", 90.0),
    "several": Target("value", ">=", 85.0),
    "poor": Target("value", ">=", 95.0),
}
"""Percent of the cases of each group that must be right by the group's rule."""

WHAT_IS_RIGHT = {
    "one": "named first",
    "weak": "named first",
    "clean": "no cause named",
    "unknown": "called unknown",
    "several": "exact set",
    "poor": "right or honest",
}
MEDIAN_EXPLAINED = Target("value", ">=", 98.0)
TENTH_EXPLAINED = Target("value", ">=", 90.0)
AT_MOST_OVER_ORACLE = Target("value", "<=", 1.3)
EXCESS_AT_LEAST_HALVED = Target("value", "<=", 50.0)
HALVED = ("flexible_mode",)
"""Effects whose compensation has to halve what they add to the error, no more."""


def campaign_figures(outcomes: Sequence[Outcome]) -> list[Figure]:
    """Return every figure of a campaign, in the order of its groups."""
    groups = by_group(outcomes)
    figures: list[Figure] = []
    for name, cases in groups.items():
        figures += _group_figures(name, cases)
    figures += _peer_figures(groups)
    figures += _closed_loop_figures(groups.get("one", []))
    _, error = calibration([(o.truth, o.answer) for o in outcomes])
    figures.append(
        Figure("calibration_error", "confidence: calibration error", 100.0 * error, PERCENT)
    )
    return [*figures, *_time_figures([o for o in outcomes if o.answer.verdict != "failed"])]


def _time_figures(answered: Sequence[Outcome]) -> list[Figure]:
    if not answered:
        return []
    figures = []
    for key, title in (("seconds", "by the clock"), ("processor_s", "processor time")):
        taken = [float(getattr(outcome.answer, key)) for outcome in answered]
        figures += [
            Figure(f"{key}_median", f"a diagnosis, {title}: median", median(taken), "s"),
            Figure(f"{key}_longest", f"a diagnosis, {title}: longest", max(taken), "s"),
        ]
    return figures


def by_group(outcomes: Iterable[Outcome]) -> dict[str, list[Outcome]]:
    """Sort outcomes by group, in the groups' order; groups without cases are left out."""
    groups: dict[str, list[Outcome]] = {name: [] for name in GROUPS}
    for outcome in outcomes:
        groups[outcome.key.group].append(outcome)
    return {name: cases for name, cases in groups.items() if cases}


def percent(hits: Iterable[bool]) -> float:
    """Return the share of hits in percent; NaN where there are none."""
    every = list(hits)
    return 100.0 * sum(every) / len(every) if every else float("nan")


def _title(group: str, count: int) -> str:
    return f"{GROUPS[group].title}: {WHAT_IS_RIGHT[group]} (of {count})"


def _group_figures(name: str, cases: Sequence[Outcome]) -> list[Figure]:
    share = percent(case.right for case in cases)
    figures = [Figure(name, _title(name, len(cases)), share, PERCENT, target=TARGETS[name])]
    title = GROUPS[name].title
    if name in ("one", "weak", "poor"):
        clear = percent(no_wrong_name(case.truth, case.answer) for case in cases)
        figures.append(Figure(f"{name}_no_wrong", f"{title}: no wrong name", clear, PERCENT))
    if name in ("one", "several"):
        explained = [case.answer.explained_fraction for case in cases]
        known = [part for part in explained if not np.isnan(part)]
        goals = (MEDIAN_EXPLAINED, TENTH_EXPLAINED) if name == "one" else (None, None)
        values = np.percentile(known, [50.0, 10.0]) if known else (float("nan"),) * 2
        for word, value, goal in zip(("median", "tenth"), values, goals, strict=True):
            key = f"{name}_explained_{word}"
            words = f"{title}: explained, {word}" + (" percentile" if word == "tenth" else "")
            figures.append(Figure(key, words, 100.0 * float(value), PERCENT, target=goal))
    return figures


@dataclass(frozen=True)
class PeerRule:
    """How a peer's answer is scored, as near to our own rule as a peer can come."""

    group: str
    right: Callable[[Truth, PeerAnswer], bool]


def _first(truth: Truth, answer: PeerAnswer) -> bool:
    return bool(answer.named) and bool(set(answer.named[0]) & set(truth))


def _nothing(_truth: Truth, answer: PeerAnswer) -> bool:
    return not answer.named


def _set(truth: Truth, answer: PeerAnswer) -> bool:
    """Tell whether every name may be read as one that is right, and none put in is missing."""
    right = set(truth) | also_right(truth)
    reached = [set(meaning) & right for meaning in answer.named]
    return all(reached) and set().union(*reached) >= set(truth)


PEER_RULES = (
    PeerRule("one", _first),
    PeerRule("clean", _nothing),
    # a peer has no word for unknown structure: to name nothing counts as honest
    PeerRule("unknown", _nothing),
    PeerRule("several", _set),
)


def _peer_figures(groups: dict[str, list[Outcome]]) -> list[Figure]:
    """Compare with each peer on the cases that it was given."""
    figures = []
    for rule in PEER_RULES:
        for library in MODULES:
            for columns in LIBRARIES:
                name = peer_name(library, columns)
                cases = [c for c in groups.get(rule.group, []) if name in c.peers]
                if not cases:
                    continue
                theirs = percent(rule.right(c.truth, c.peers[name]) for c in cases)
                ours = percent(RULES[rule.group](c.truth, c.answer) for c in cases)
                figures.append(
                    Figure(
                        name=f"{rule.group}_{library.lower()}_{columns}",
                        title=_title(rule.group, len(cases)),
                        value=ours,
                        unit=PERCENT,
                        peer=name,
                        peer_value=theirs,
                    )
                )
    return figures


def _closed_loop_figures(cases: Sequence[Outcome]) -> list[Figure]:
    """Return each effect's median over its cases; a loop that failed counts as infinite."""
    driven: dict[str, list[Outcome]] = {}
    for case in cases:
        if case.closed_loop is not None or case.closed_loop_failure:
            driven.setdefault(next(iter(case.truth)), []).append(case)
    figures = []
    for effect, outcomes in driven.items():
        loops = [o.closed_loop for o in outcomes]
        over = median(float("inf") if loop is None else loop.over_oracle for loop in loops)
        halved = effect in HALVED
        figures.append(
            Figure(
                name=f"closed_loop_{effect}",
                title=f"refined / oracle: {effect} (of {len(loops)})",
                value=over,
                unit="x",
                target=None if halved else AT_MOST_OVER_ORACLE,
            )
        )
        if halved:
            left = median(float("inf") if loop is None else loop.excess_left for loop in loops)
            title = f"excess left: {effect}"
            figures.append(
                Figure(
                    f"excess_{effect}", title, 100.0 * left, PERCENT, target=EXCESS_AT_LEAST_HALVED
                )
            )
    return figures
