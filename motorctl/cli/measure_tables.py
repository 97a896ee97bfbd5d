"""Tables of the published measures on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from motorctl.cli.terminal import Terminal
from motorctl.identify.compare.measures import (
    DurationFigures,
    MeasuredRun,
    table_cells,
    table_headings,
)
from motorctl.identify.compare.runs import Comparison, told_ratio

COLUMNS = table_headings()

Rows = Sequence[tuple[str, Sequence[str]]]
"""Name and cells of each row."""


def print_measures(axis: str, groups: Sequence[Rows], headings: Sequence[str] = COLUMNS) -> None:
    """Print the table of an axis, with a line between one group of rows and the next."""
    table = Table(title=f"Axis {escape(axis)}", title_justify="left")
    table.add_column("run")
    for heading in headings:
        table.add_column(escape(heading), justify="right")
    for rows in groups:
        for name, cells in rows:
            table.add_row(escape(name), *map(escape, cells))
        table.add_section()
    Terminal().print(table)


def print_comparison(comparison: Comparison) -> None:
    """Print the measures of every run, and the first run's over each other one's."""
    console = Terminal()
    first, *later = comparison.runs
    for axis in comparison.axes:
        measured = [(name, table_cells(m)) for name, m in comparison.measures(axis).items()]
        ratios = [
            (f"{first.label} / {run.label}", [told_ratio(value) for value in ratio.values()])
            for run, ratio in zip(later, comparison.ratios(axis), strict=True)
        ]
        print_measures(axis, [measured, ratios], table_headings(*comparison.units(axis)))
        for words in dict.fromkeys(_period(run.axes[axis]) for run in comparison.runs):
            console.print(f"  eF over the last two periods; {words}", highlight=False)
    for run in comparison.runs:
        timing = (("turnaround", run.timing.turnaround), ("lateness", run.timing.lateness))
        told = [f"{name} {_told(found)}" for name, found in timing if found is not None]
        for words in (*told, *run.recording.notes):
            console.print(f"  {escape(run.label)}: {escape(words)}", highlight=False)


def _period(run: MeasuredRun) -> str:
    length = "" if run.period_s is None else f" {run.period_s:.4g} s,"
    return f"period{length} {run.period_from}"


def _told(found: DurationFigures) -> str:
    return (
        f"median {found.median_s * 1e6:.1f} µs, 99 % {found.p99_s * 1e6:.1f}, "
        f"99.9 % {found.p999_s * 1e6:.1f}, worst {found.worst_s * 1e6:.1f} µs "
        f"at {found.worst_at_s:.4g} s"
    )
