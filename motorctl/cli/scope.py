"""`motorctl scope`: logs, or a running machine, in the browser."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.errors import UsageError
from motorctl.extras import require


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "scope",
        epilog="Example: motorctl scope before.parquet after.parquet\n\n"
        "Example: motorctl scope --captures captures",
    )(_scope)


def _scope(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[LOG]...",
            help="Logs, unfinished ones, or foreign recordings; several are shown side by side. "
            "None: the machine that a daemon runs.",
            show_default=False,
        ),
    ] = None,
    socket: SocketOption = None,
    captures: Annotated[
        Path, typer.Option(metavar="DIR", help="Where captures of a running machine go.")
    ] = Path("captures"),
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="The page's port; 0: any that is free.")
    ] = 0,
    address: Annotated[
        str,
        typer.Option(help="Where the page is served; any but 127.0.0.1 asks for a token."),
    ] = "127.0.0.1",
) -> None:
    """Show logs, or a running machine, in a browser: from the whole down to single rows."""
    require("motorctl scope", "scope", "aiohttp")
    from motorctl.scope.server import Logs, serve

    if logs and socket is not None:
        raise UsageError("scope: name logs, or the socket of a running daemon, not both")
    if not address:
        raise UsageError("--address: is empty: name one, as 127.0.0.1, or 0.0.0.0 for all")
    shown = Logs.of(logs) if logs else Logs.of_machine(socket, captures)
    for why in shown.refused.values():
        say(f"motorctl: not shown: {why}", err=True)

    def ready(url: str) -> None:
        say(f"{url}  (Ctrl-C ends)")

    try:
        with suppress(KeyboardInterrupt):
            asyncio.run(serve(shown, address, port, ready))
    finally:
        shown.close()
