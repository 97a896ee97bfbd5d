"""`motorctl bench`: speed figures beside peers that are measured in the same run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from motorctl.bench.subject import Result


def bench(
    subject: Annotated[str, typer.Argument(help="What to measure: speed.")] = "speed",
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
) -> None:
    """Measure how fast motorctl is on this machine, as ratios to peers in the same run.

    The exit status is 0 whether or not the targets are met: what is not met is told.

    Example: motorctl bench --json
    """
    from rich.console import Console

    from motorctl.bench.host import host_line
    from motorctl.bench.subject import measure
    from motorctl.cli.progress import showing_progress

    with showing_progress("measuring; the first run compiles the kernels") as progress:
        result = measure(subject, progress)
    if as_json:
        typer.echo(json.dumps(result.document(), indent=2))
        return
    console = Console()
    console.print(host_line(result.host), highlight=False)
    console.print(_table(result))
    for note in result.notes:
        console.print(note, highlight=False)
    for sentence in result.missed:
        console.print(f"[yellow]not met[/yellow]  {sentence}", highlight=False)
    if not result.missed:
        console.print("[green]every target is met[/green]")


def _table(result: Result) -> Table:
    from rich.table import Table

    table = Table(title=result.subject, title_justify="left", title_style="bold")
    table.add_column("figure")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("peer")
    table.add_column("ratio", justify="right", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    table.add_column("met")
    marks = {True: "[green]yes[/green]", False: "[red]no[/red]", None: ""}
    for figure in result.figures:
        peer = figure.peer or ""
        if figure.peer_value is not None:
            peer += f": {figure.peer_value:.3g} {figure.unit}"
        table.add_row(
            figure.title,
            f"{figure.value:.3g} {figure.unit}",
            peer,
            "" if figure.ratio is None else f"{figure.ratio:.3g}",
            str(figure.target or ""),
            marks[figure.met],
        )
    return table


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(bench)
