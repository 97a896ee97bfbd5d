"""`motorctl effects`: what a model may be made of, and what was refused and why."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from motorctl.cli.say import say


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("effects", epilog="Example: motorctl effects --json")(_effects)


def _effects(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """List the effects that are built in or installed, and what was refused and why."""
    from motorctl.model.catalog import built_in_entries, installed_effects

    rows: list[dict[str, Any]] = [
        {"name": entry.name, "package": entry.package, "version": entry.version,
         "kind": entry.effect.kind if entry.effect else None,
         "title": entry.effect.title if entry.effect else None, "error": entry.error}
        for entry in (*built_in_entries(), *installed_effects())
    ]  # fmt: skip
    if as_json:
        say(json.dumps({"effects": rows}, indent=2))
    else:
        _print_table(rows)


def _print_table(rows: list[dict[str, Any]]) -> None:
    from rich.markup import escape

    from motorctl.cli.terminal import Terminal, open_table

    table = open_table("Effects", ("name", "package", "kind", "what it is"))
    for row in rows:
        told = escape(row["title"] or "") if row["error"] is None else ""
        if row["error"] is not None:
            told = f"[red]refused: {escape(row['error'])}[/red]"
        table.add_row(row["name"], row["package"], row["kind"] or "?", told)
    Terminal().print(table)
