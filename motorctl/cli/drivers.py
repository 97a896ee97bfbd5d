"""`motorctl drivers`: what is installed, and what failed to load and why."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.say import say

if TYPE_CHECKING:
    from motorctl.hal import DriverEntry


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("drivers", epilog="Example: motorctl drivers --json")(_drivers)


def _drivers(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """List the installed drivers, with versions and what failed to load and why."""
    from motorctl.hal import installed_drivers

    entries = installed_drivers()
    if as_json:
        say(json.dumps({"drivers": [_plain(entry) for entry in entries]}, indent=2))
    else:
        _print_table(entries)


def _plain(entry: DriverEntry) -> dict[str, object]:
    return {
        "name": entry.name,
        "package": entry.distribution,
        "version": entry.version,
        "class": entry.target,
        "loaded": entry.driver is not None,
        "supports_virtual_time": entry.driver.supports_virtual_time if entry.driver else None,
        "error": entry.error,
    }


def _print_table(entries: list[DriverEntry]) -> None:
    from rich.markup import escape

    from motorctl.cli.terminal import Terminal, open_table

    columns = ("name", "package", "version", "class", "virtual", "state")
    table = open_table("Drivers", columns)
    for entry in entries:
        virtual = "?"
        if entry.driver is not None:
            virtual = "yes" if entry.driver.supports_virtual_time else "no"
        state = "ready" if entry.error is None else f"[red]{escape(entry.error)}[/red]"
        table.add_row(entry.name, entry.distribution, entry.version, entry.target, virtual, state)
    Terminal().print(table)
