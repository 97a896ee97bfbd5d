"""The demonstration's tables, for the terminal and the page."""

from __future__ import annotations

from collections.abc import Mapping

from motorctl.close_loop.judge import MOTION_WORDS
from motorctl.close_loop.rounds import ClosedLoop
from motorctl.demo.plant import undeclared_effects
from motorctl.identify.compare.measures import SYMBOLS, Measures, table_cells
from motorctl.identify.compare.published import TABLES
from motorctl.identify.compare.runs import Comparison, ratios
from motorctl.identify.diagnose.report.parameter_text import found_values, percent
from motorctl.identify.diagnose.report.tables import effect_rows
from motorctl.identify.diagnose.result import FoundEffect
from motorctl.model import effect_class

NONE = "–"


def published_beside_ours(comparison: Comparison, axis: str) -> list[tuple[str, list[str]]]:
    """Return the rows of one axis' table: name and cells, in µm and V."""
    ours = {run.label: run.axes[axis].measures for run in comparison.runs}
    rows = []
    for whose, table in (("published", TABLES[axis]), ("simulated", ours)):
        rows += [(f"{whose} {name}", table_cells(measures)) for name, measures in table.items()]
        ratio = ratios(table["C1"], table["C2"])
        rows.append((f"{whose} C1 / C2", [f"{value:.2f}" for value in ratio.values()]))
    return rows


def verdict(comparison: Comparison) -> str:
    """Put the outcome of the published experiment into one sentence."""
    parts = []
    for axis in comparison.axes:
        first, second = (run.axes[axis].measures for run in comparison.runs)
        parts.append(f"{ratios(first, second)['eF']:.2f} times smaller on {axis}")
    return (
        "Compensating the motor's electromagnetic nonlinearity (C2) makes the final tracking "
        f"error {' and '.join(parts)} than without (C1)."
    )


def first_sentence(loop: ClosedLoop, axis: str) -> str:
    """Return what the first diagnosis says of an axis."""
    diagnosis = loop.rounds[0].diagnosis
    if axis in diagnosis.axes:
        return diagnosis.axes[axis].sentence
    return f"It was not diagnosed: {diagnosis.refused[axis]}"


def kept_effects(loop: ClosedLoop, axis: str) -> dict[str, FoundEffect]:
    """Return the effects that were found on an axis and kept, by name, in the order of rounds."""
    kept: dict[str, FoundEffect] = {}
    for part in loop.rounds:
        if part.accepted is None or axis not in part.accepted.refinement.axes:
            continue
        added = part.accepted.refinement.axes[axis].added
        kept |= {e.name: e for e in part.diagnosis.axes[axis].effects if e.name in added}
    return kept


def found_beside_plant(loop: ClosedLoop, axis: str) -> list[tuple[str, str, str, str]]:
    """Return effect, what the simulated plant has of it, what was found, how much it explains."""
    there = undeclared_effects(loop.first.machine, axis)
    kept = kept_effects(loop, axis)
    rows = []
    for name in dict.fromkeys((*kept, *there)):
        told, explained = _not_found(name, kept), NONE
        if name in kept:
            found = kept[name]
            data = next(
                part.diagnosis.axes[axis].data
                for part in loop.rounds
                if found in part.diagnosis.axes[axis].effects
            )
            told = ", ".join(
                f"{_plain(key)} {value}"
                for key, value, _ in effect_rows(data, found.effect, found_values(data, found))
                if not key.startswith("phase")
            )
            explained = percent(found.explained_fraction)
        rows.append((name, there.get(name, "not there"), told, explained))
    return rows


def _not_found(name: str, kept: Mapping[str, FoundEffect]) -> str:
    """Return in words that an effect was not found, and what may stand for it."""
    groups = effect_class(name).groups
    alike = [other for other, found in kept.items() if groups & found.effect.groups]
    if not alike:
        return "not found"
    return f"not found by itself: {' or '.join(alike)}, of the same kind, may stand for both"


def before_and_after(loop: ClosedLoop) -> list[tuple[str, str, dict[str, str]]]:
    """Return axis, motion, and each measure before and after, in µm and V."""
    rows = []
    for axis, judgement in loop.overall.items():
        for motion, pair in judgement.tracking.items():
            cells = [table_cells(measures) for measures in pair]
            arrows = [f"{old} → {new}" for old, new in zip(*cells, strict=True)]
            rows.append((axis, MOTION_WORDS[motion], dict(zip(SYMBOLS, arrows, strict=True))))
    return rows


def gains(loop: ClosedLoop) -> str:
    """Put the outcome of the closed loop into one sentence."""
    if loop.first is loop.last:
        return f"Nothing was changed: {loop.ended}."
    judged = loop.overall
    own = [_times(axis, j.tracking["own"], "eF") for axis, j in judged.items()]
    unused = [_times(axis, j.tracking["unused"], "L2[e]") for axis, j in judged.items()]
    step = loop.velocity
    matched = "" if step is None or not step.kept else ", and the velocity matched"
    told = (
        f"With what was found added{matched}, C2's final tracking error is {' and '.join(own)} "
        "than before; on moves that no fit has used its root mean square is "
        f"{' and '.join(unused)}."
    )
    if step is None or not step.kept:
        return told
    alone = [
        _times(axis, step.judgements[axis].tracking["own"], "eF") for axis in sorted(step.kept)
    ]
    return f"{told} Of this the matched velocity alone makes it {' and '.join(alone)}."


def _times(axis: str, pair: tuple[Measures, Measures], symbol: str) -> str:
    return f"{ratios(*pair)[symbol]:.1f} times smaller on {axis}"


def _plain(name: str) -> str:
    """Name a value for people: without its unit, which the value tells, and orders as such."""
    if name.startswith("amplitude_"):
        return f"order {name.removeprefix('amplitude_')}:"
    ends = (end for end in ("_m_s", "_m", "_s", "_v", "_hz") if name.endswith(end))
    return name.removesuffix(next(ends, "")).replace("_", " ")
