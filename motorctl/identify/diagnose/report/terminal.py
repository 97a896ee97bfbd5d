"""A diagnosis on the terminal: the verdict first, then what it rests on, then what to do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from motorctl.identify.diagnose.report.next_steps import Step
from motorctl.identify.diagnose.report.parameter_text import (
    compensation_values,
    found_values,
    percent,
)
from motorctl.identify.diagnose.report.tables import (
    NO_VALUE,
    Rows,
    effect_rows,
    error_rows,
    parameter_rows,
    stretch_rows,
)
from motorctl.identify.diagnose.result import (
    Alternative,
    AxisDiagnosis,
    FoundEffect,
    RecordingDiagnosis,
)

VERDICT_STYLES = {
    "complete": "bold green",
    "effect": "bold yellow",
    "unknown_structure": "bold magenta",
    "insufficient_data": "bold red",
}
INDENT = 2
"""Columns of the terminal that lines are indented by. Only looks depend on it. Convention."""
DEEPER = 5
"""Columns that lines under another one are indented by. Only looks depend on it. Convention."""
WIDE = 110
"""Width of the terminal [columns] from which the parameters are shown as forces too. Smaller breaks
the table's lines. Chosen by hand."""


def print_diagnosis(
    console: Console, diagnosis: RecordingDiagnosis, steps: Mapping[str, Sequence[Step]]
) -> None:
    """Print every axis of a diagnosis; `steps` as `next_steps` gives them."""
    _line(
        console,
        f"{diagnosis.source}: {diagnosis.duration_s:.6g} s at {diagnosis.sample_rate_hz:g} Hz",
    )
    for note in diagnosis.notes:
        _line(console, f"note: {note}", INDENT)
    for name, axis in diagnosis.axes.items():
        console.print()
        _print_axis(console, name, axis)
        if steps.get(name):
            _line(console, "next", 0, "bold")
        for step in steps.get(name, ()):
            _line(console, step.text, INDENT)
            if step.command:
                # as one line, so that it can be copied
                command = Text(f"    {step.command}", "cyan", no_wrap=True, overflow="ignore")
                console.print(command, soft_wrap=True)
    for name, reason in diagnosis.refused.items():
        console.print()
        _line(console, f"axis {name} was not diagnosed: {reason}")


def _print_axis(console: Console, name: str, axis: AxisDiagnosis) -> None:
    sentence = Text(f"axis {name}: ", "bold")
    sentence.append(axis.sentence, VERDICT_STYLES[axis.verdict])
    console.print(sentence)
    for k, found in enumerate(axis.effects, 1):
        _print_effect(console, k, axis, found)
    if axis.unknown is not None:
        _line(console, axis.unknown.sentence, INDENT)
        if axis.unknown.compensation is not None:
            values = compensation_values(axis.data, axis.unknown)
            for row in effect_rows(axis.data, axis.unknown.compensation, values):
                _line(console, _row(row), DEEPER)
    for missing in axis.missing:
        _line(console, f"not shown by this motion: {', '.join(missing.effects)}", INDENT)
        _line(console, missing.why, DEEPER)
        _line(console, f"what would show it: {missing.motion}", DEEPER)
    if axis.read is not None:
        _line(console, axis.read.sentence, INDENT)
    for title, (headings, rows) in (
        ("what was read of the log", stretch_rows(axis)),
        ("error, before and after", error_rows(axis)),
        ("parameters", parameter_rows(axis, forces=console.width >= WIDE)),
    ):
        if rows:
            console.print(_table(title, headings, rows))
    for effect, reason in axis.dropped.items():
        _line(console, f"{effect} is declared but was left out: {reason}", INDENT)
    for note in axis.notes:
        _line(console, f"note: {note}", INDENT)


def _print_effect(console: Console, k: int, axis: AxisDiagnosis, found: FoundEffect) -> None:
    console.print()
    heading = Text(f"  {k}. {found.name}", "bold")
    heading.append(f"  ({found.effect.title.lower()})", "not bold")
    console.print(heading)
    _line(
        console,
        f"confidence {percent(found.confidence)}; explains "
        f"{percent(found.explained_fraction)} of the explainable error",
        DEEPER,
    )
    for row in effect_rows(axis.data, found.effect, found_values(axis.data, found)):
        _line(console, _row(row), DEEPER)
    for words in found.evidence:
        _line(console, f"- {words}", DEEPER)
    if found.indistinguishable_from:
        rivals = ", ".join(found.indistinguishable_from)
        _line(console, f"this recording cannot tell it apart from: {rivals}", DEEPER, "yellow")
    for alternative in found.alternatives:
        _line(console, _rejected(alternative), DEEPER)


def _row(row: tuple[str, ...]) -> str:
    name, value, force = row
    return f"{name} = {value}" + (f"  ({force})" if force not in ("", NO_VALUE) else "")


def _rejected(alternative: Alternative) -> str:
    """Return in words why an explanation was not taken."""
    share = ""
    if math.isfinite(alternative.share):
        share = f" (reaches {percent(alternative.share)} of its score)"
    return f"not {alternative.name}{share}: {alternative.why_not}"


def _table(title: str, headings: Sequence[str], rows: Rows) -> Padding:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    return Padding(table, (1, 0, 0, INDENT), expand=False)


def _line(console: Console, words: str, indent: int = 0, style: str = "") -> None:
    """Print words as they are, later lines as far in as the first."""
    console.print(Padding(Text(words, style), (0, 0, 0, indent), expand=False))
