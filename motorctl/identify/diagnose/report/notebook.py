"""A diagnosis as notebooks show it: its verdicts, tables and evidence in HTML, and as a frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from motorctl.identify.diagnose.report.parameter_text import (
    compensation_values,
    found_values,
    percent,
)
from motorctl.identify.diagnose.report.tables import (
    Rows,
    effect_rows,
    error_rows,
    parameter_rows,
    stretch_rows,
)
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.notebook import frame_of_rows, html_lines, html_table

if TYPE_CHECKING:
    import pandas as pd

FRAME = (
    "axis",
    "verdict",
    "effect",
    "confidence",
    "explained_fraction",
    "parameter",
    "value",
    "std_error",
    "unit",
)


def diagnosis_html(diagnosis: RecordingDiagnosis) -> str:
    """Return verdict, effects, errors and parameters of every axis in HTML."""
    heading = f"{diagnosis.source}: {diagnosis.duration_s:.6g} s at {diagnosis.sample_rate_hz:g} Hz"
    parts = [html_lines((f"note: {note}" for note in diagnosis.notes), heading)]
    for name, axis in diagnosis.axes.items():
        parts += _axis(name, axis)
    refused = diagnosis.refused.items()
    parts.append(html_lines(f"axis {name} was not diagnosed: {why}" for name, why in refused))
    return "".join(parts)


def _axis(name: str, axis: AxisDiagnosis) -> Iterator[str]:
    yield html_lines((), f"axis {name}: {axis.sentence}")
    for found in axis.effects:
        title = (
            f"{found.name} ({found.effect.title.lower()}): confidence {percent(found.confidence)}, "
            f"explains {percent(found.explained_fraction)} of the explainable error"
        )
        values = found_values(axis.data, found)
        yield _values(effect_rows(axis.data, found.effect, values), title)
        yield html_lines(found.evidence)
        if found.indistinguishable_from:
            rivals = ", ".join(found.indistinguishable_from)
            yield html_lines((f"this recording cannot tell it apart from: {rivals}",))
    if axis.unknown is not None:
        yield html_lines((axis.unknown.sentence,))
        if (spline := axis.unknown.compensation) is not None:
            values = compensation_values(axis.data, axis.unknown)
            yield _values(effect_rows(axis.data, spline, values), spline.name)
    for missing in axis.missing:
        shown = f"not shown by this motion: {', '.join(missing.effects)}: {missing.why}"
        yield html_lines((shown, f"what would show it: {missing.motion}"))
    if axis.read is not None:
        yield html_lines((axis.read.sentence,))
        yield html_table(*stretch_rows(axis), "what was read of the log")
    yield html_table(*error_rows(axis), "error, before and after")
    yield html_table(*parameter_rows(axis), "parameters")
    left_out = (f"{effect} was left out: {why}" for effect, why in axis.dropped.items())
    yield html_lines((*left_out, *(f"note: {note}" for note in axis.notes)))


def _values(rows: Rows, title: str) -> str:
    """Return a table of values, with forces where any is known."""
    width = 3 if any(row[2] for row in rows) else 2
    headings = ("", "value ± standard error", "as a force")[:width]
    return html_table(headings, [row[:width] for row in rows], title)


def diagnosis_frame(diagnosis: RecordingDiagnosis) -> pd.DataFrame:
    """Return a row for each parameter of each found effect; one of an axis without any."""
    rows = [row for name, axis in diagnosis.axes.items() for row in _rows(name, axis)]
    return frame_of_rows(rows, FRAME)


def _rows(name: str, axis: AxisDiagnosis) -> list[dict[str, Any]]:
    told = {"axis": name, "verdict": axis.verdict}
    rows = []
    for found in axis.effects:
        effect = {
            "effect": found.name,
            "confidence": found.confidence,
            "explained_fraction": found.explained_fraction,
        }
        values = found_values(axis.data, found)
        rows += [
            told | effect | {"parameter": parameter, **vars(value)}
            for parameter, value in values.items()
        ]
        if not values:
            rows.append(told | effect)
    return rows or [told]
