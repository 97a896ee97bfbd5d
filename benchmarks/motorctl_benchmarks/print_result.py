"""Measure a subject of `motorctl bench` and print what was found."""

from __future__ import annotations

import json
from collections.abc import Callable

import typer
from rich.markup import escape
from rich.table import Table

from motorctl.cli.progress import showing_progress
from motorctl.cli.say import say
from motorctl.cli.terminal import Terminal
from motorctl.json_values import plain
from motorctl.latency.host import host_line
from motorctl.latency.progress import Progress
from motorctl.printable import one_line
from motorctl_benchmarks.findings import Findings
from motorctl_benchmarks.measure import Result, measure

MISTAKES_SHOWN = 60
WIDTH_OF_A_FILE = 120


def measure_and_print(subject: str, find: Callable[[Progress], Findings], *, as_json: bool) -> None:
    """Measure a subject and print it: as JSON, as lines for a page of the docs, or as a table.

    Parameters
    ----------
    subject
        Its name.
    find
        Measures it.
    as_json
        One JSON document on stdout, and nothing else.

    Raises
    ------
    typer.Exit
        Exit status 1 where something is not as it has to be.
    """
    with showing_progress("measuring; the first run compiles the kernels") as progress:
        result = measure(subject, find, progress)
    if as_json:
        say(json.dumps(plain(result.document()), indent=2, allow_nan=False))
    elif result.found.head:
        _print_page(result)
    else:
        _print_table(result)
    if result.found.failed:
        raise typer.Exit(1)


def _print_table(result: Result) -> None:
    console, found = Terminal(), result.found
    if not console.is_terminal:
        console = Terminal(width=WIDTH_OF_A_FILE)
    console.print(host_line(result.host), highlight=False)
    console.print(_table(result))
    for table in found.tables:
        say("\n" + "\n".join(table.lines()) + "\n")
    for note in found.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    _print_mistakes(console, found)
    for sentence in result.missed:
        console.print(f"[yellow]not met[/yellow]  {escape(sentence)}", highlight=False)
    if not result.missed:
        console.print("[green]every target is met[/green]")


def _print_page(result: Result) -> None:
    """Print Markdown and nothing else, to stand in a page as it is: what was wrong comes first."""
    host, found = result.host, result.found
    lines = [
        f"{found.head} {host['cpu']}, {host['cpus']} CPUs, Python {host['python']}, "
        f"numpy {host['numpy']}, numba {host['numba']}."
    ]
    if found.mistakes:
        lines += ["", *(f"- wrong  {r['case']}  {r['truth']}  ->  {r['answer']}"
                        for r in found.mistakes)]  # fmt: skip
    for table in found.tables:
        lines += ["", *table.lines()]
    if found.notes:
        lines += ["", *(f"- {note}" for note in found.notes)]
    say("\n".join(lines))


def _print_mistakes(console: Terminal, found: Findings) -> None:
    for row in found.mistakes[:MISTAKES_SHOWN]:
        words = f"{row['case']}  {row['truth']}  ->  {row['answer']}"
        console.print(f"wrong  {words}", highlight=False, markup=False, soft_wrap=True)
    more = len(found.mistakes) - MISTAKES_SHOWN
    if more > 0:
        console.print(f"and {more} more; --out keeps all of them", highlight=False)


def _table(result: Result) -> Table:
    table = Table(title=result.subject, title_justify="left", title_style="bold")
    table.add_column("figure")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("peer")
    ratios = any(figure.ratio is not None for figure in result.found.figures)
    if ratios:
        table.add_column("ratio", justify="right", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    table.add_column("met")
    marks = {True: "[green]yes[/green]", False: "[red]no[/red]", None: ""}
    for figure in result.found.figures:
        peer = figure.peer or ""
        if figure.peer_value is not None:
            peer += f": {figure.peer_value:.3g} {figure.unit}"
        ratio = "" if figure.ratio is None else f"{figure.ratio:.3g}"
        table.add_row(
            escape(one_line(figure.title)),
            f"{figure.value:.3g} {figure.unit}",
            escape(one_line(peer)),
            *([ratio] if ratios else []),
            str(figure.target or ""),
            marks[figure.met],
        )
    return table
