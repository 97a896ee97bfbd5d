"""`motorctl status`: how machine, loop and recording are doing."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption

if TYPE_CHECKING:
    from collections.abc import Callable

    from motorctl import Connection

WATCH_PERIOD_S = 0.1


def status(
    axis: Annotated[
        str | None, typer.Argument(metavar="[AXIS]", help="One axis only, with its parameters.")
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Show it live; a space is an emergency stop, q leaves.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
    socket: SocketOption = None,
) -> None:
    """Show states, positions, errors and timing.

    Example: motorctl status --watch
    """
    from motorctl import connect
    from motorctl.cli.status_view import status_view
    from motorctl.cli.terminal import Terminal
    from motorctl.errors import UsageError

    if watch and as_json:
        raise UsageError("--watch and --json exclude each other")
    with connect(socket) as machine:
        if watch:
            with connect(socket) as other:  # so that no status is waited for before it stops
                _watch(machine, axis, other.estop)
            return
        document = machine.ask("status", axis=axis)
        if as_json:
            say(json.dumps(document, indent=2))
        else:
            Terminal().print(status_view(document, detailed=axis is not None))


def _watch(machine: Connection, axis: str | None, stop: Callable[[], object]) -> None:
    """Show the status until q is pressed; a space is an emergency stop at once."""
    from rich.console import Group
    from rich.live import Live
    from rich.text import Text

    from motorctl.cli.keys import LEAVE, single_keys
    from motorctl.cli.status_view import status_view
    from motorctl.cli.terminal import Terminal

    console = Terminal()
    hint = Text("q: leave   space: emergency stop of every axis", "dim")
    with (
        single_keys(stop) as keys,
        # On a screen of its own, so that nothing is left over where the window changes its size.
        Live(console=console, auto_refresh=False, screen=keys is not None) as live,
    ):
        key: str | None = None
        while key != LEAVE:
            document = machine.ask("status", axis=axis)
            view = status_view(document, detailed=axis is not None)
            live.update(view if keys is None else Group(view, hint), refresh=True)
            try:
                if keys is None:
                    time.sleep(WATCH_PERIOD_S)
                else:
                    key = keys.next(WATCH_PERIOD_S)
            except KeyboardInterrupt:
                break
    if keys is not None:
        console.print(view)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(status)
