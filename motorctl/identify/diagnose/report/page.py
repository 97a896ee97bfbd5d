"""A diagnosis as one self-contained page that can be mailed, and its pictures as files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from motorctl.html_pages import Figure, figure, write_page
from motorctl.identify.compare.measures import EXPLAINED, table_headings
from motorctl.identify.diagnose.report.next_steps import Step, next_steps
from motorctl.identify.diagnose.report.parameter_text import (
    compensation_values,
    found_values,
    percent,
)
from motorctl.identify.diagnose.report.pictures.all import Picture, plot_diagnosis
from motorctl.identify.diagnose.report.tables import (
    TrackedAxis,
    TrackingComparison,
    effect_rows,
    error_rows,
    parameter_rows,
    stretch_rows,
    tracking_rows,
)
from motorctl.identify.diagnose.result import AxisDiagnosis, FoundEffect, RecordingDiagnosis

__all__ = ["TrackedAxis", "TrackingComparison", "write_report"]

FILE_NAME = "diagnosis.html"
HEADINGS = ("parameter", "value ± standard error", "as a force")
VERDICTS = {
    "complete": "complete",
    "effect": "effect found",
    "unknown_structure": "unknown structure",
    "insufficient_data": "insufficient data",
}


def write_report(
    path_or_dir: Path,
    diagnosis: RecordingDiagnosis,
    *,
    comparison: TrackingComparison | None = None,
    config_change: str | None = None,
    commands: Sequence[str] = (),
    steps: Mapping[str, Sequence[Step]] | None = None,
) -> list[Path]:
    """Write the page and, beside it, its pictures as PNG; return the files, the page first.

    `path_or_dir` is a folder, or a path that ends in .html. `comparison` are tracking errors
    before and after, `config_change` is the text of a unified diff, `commands` are what to run
    next, beside the steps that follow from the verdict (`steps`, else made here). Raises
    UsageError where the files cannot be written.
    """
    page = path_or_dir if path_or_dir.suffix == ".html" else path_or_dir / FILE_NAME
    pictures = plot_diagnosis(diagnosis, page.parent)
    refined = config_change is not None
    todo = next_steps(diagnosis, refined=refined) if steps is None else steps
    write_page(
        page,
        "motorctl.identify.diagnose.report",
        "page.html",
        source=diagnosis.source,
        measures=EXPLAINED,
        span=f"{diagnosis.duration_s:.4g} s at {diagnosis.sample_rate_hz:g} Hz",
        notes=diagnosis.notes,
        axes=[
            _axis(name, axis, pictures, todo.get(name, ())) for name, axis in diagnosis.axes.items()
        ],
        refused=diagnosis.refused,
        tracking=None if comparison is None else _tracking(comparison),
        change=config_change,
        commands=list(commands),
    )
    return [page, *(picture.path for picture in pictures)]


def _axis(
    name: str, axis: AxisDiagnosis, pictures: Sequence[Picture], steps: Sequence[Step]
) -> dict[str, Any]:
    own = {p.about: figure(p.path, p.caption) for p in pictures if p.axis == name}
    parameters, errors, read = parameter_rows(axis), error_rows(axis), stretch_rows(axis)
    unknown = axis.unknown
    return {
        "name": name,
        "verdict": axis.verdict,
        "verdict_words": VERDICTS[axis.verdict],
        "sentence": axis.sentence,
        "read": "" if axis.read is None else axis.read.sentence,
        "stretches": (read[0], [read[1]]),
        "errors": (errors[0], [errors[1]]),
        "parameters": (parameters[0], [parameters[1]]),
        "effects": [_effect(axis, found, own.get(found.name)) for found in axis.effects],
        "unknown": None
        if unknown is None
        else {
            "sentence": unknown.sentence,
            "depends_on": ", ".join(unknown.depends_on),
            "explained": percent(unknown.explained_fraction),
            "compensation": unknown.compensation and unknown.compensation.name,
            "rows": effect_rows(
                axis.data, unknown.compensation, compensation_values(axis.data, unknown)
            )
            if unknown.compensation
            else [],
            "picture": own.get("unknown"),
        },
        "missing": [
            {"effects": ", ".join(m.effects), "why": m.why, "motion": m.motion}
            for m in axis.missing
        ],
        "dropped": dict(axis.dropped),
        "declared": ", ".join(axis.declared.names),
        "residual": own.get("residual"),
        "spectrum": own.get("spectrum"),
        "notes": axis.notes,
        "steps": steps,
    }


def _effect(axis: AxisDiagnosis, found: FoundEffect, picture: Figure | None) -> dict[str, Any]:
    rows = effect_rows(axis.data, found.effect, found_values(axis.data, found))
    width = 3 if any(force for _, _, force in rows) else 2
    return {
        "name": found.name,
        "title": found.effect.title,
        "formula": found.effect.formula,
        "compensated": found.effect.compensated,
        "confidence": percent(found.confidence),
        "explained": percent(found.explained_fraction),
        "headings": HEADINGS[:width],
        "rows": [row[:width] for row in rows],
        "evidence": found.evidence,
        "rivals": ", ".join(found.indistinguishable_from),
        "alternatives": [
            (other.name, percent(other.share), other.why_not) for other in found.alternatives
        ],
        "picture": picture,
    }


def _tracking(comparison: TrackingComparison) -> list[dict[str, Any]]:
    """Return a table for each pair of units, since headings tell them."""
    units = dict.fromkeys((row.position_unit, row.command_unit) for row in comparison.rows)
    tables = []
    for pair in units:
        rows = tuple(r for r in comparison.rows if (r.position_unit, r.command_unit) == pair)
        part = TrackingComparison(rows, comparison.before, comparison.after)
        headings = ["trajectory", "axis", "run", *table_headings(*pair)]
        tables.append({"headings": headings, "groups": tracking_rows(part)})
    return tables
