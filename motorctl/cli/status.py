"""`motorctl status`: how machine, loop and recording are doing."""

from __future__ import annotations

import json
import time
from typing import Annotated

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption

WATCH_PERIOD_S = 0.1


def status(
    axis: Annotated[
        str | None, typer.Argument(metavar="[AXIS]", help="One axis only, with its parameters.")
    ] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Stay and show it live.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
    socket: SocketOption = None,
) -> None:
    """Show states, positions, errors and timing.

    Example: motorctl status --watch
    """
    from rich.live import Live

    from motorctl import connect
    from motorctl.cli.status_view import status_view
    from motorctl.cli.terminal import Terminal
    from motorctl.errors import UsageError

    if watch and as_json:
        raise UsageError("--watch and --json exclude each other")
    with connect(socket) as machine:
        document = machine.ask("status", axis=axis)
        if as_json:
            say(json.dumps(document, indent=2))
            return
        console = Terminal()
        if not watch:
            console.print(status_view(document, detailed=axis is not None))
            return
        with Live(console=console, auto_refresh=False) as live:
            try:
                while True:
                    live.update(status_view(document, detailed=axis is not None), refresh=True)
                    time.sleep(WATCH_PERIOD_S)
                    document = machine.ask("status", axis=axis)
            except KeyboardInterrupt:
                return


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(status)
