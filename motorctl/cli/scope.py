"""`motorctl scope`: logs, or a running machine, in the browser."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

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
        "Example: motorctl scope --captures captures\n\n"
        "Example: motorctl scope --store findings --port 8765",
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
    store: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="The findings of a fleet: any of its logs, from the links of `fleet report`.",
            show_default=False,
        ),
    ] = None,
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
    if store is not None:
        if logs or socket is not None:
            raise UsageError("scope: --store shows the logs of a fleet, and nothing beside them")
        require("motorctl scope --store", "fleet", "fsspec")
        from motorctl.fleet.log_index import LogIndex

        _run(serve(LogIndex(store).find, address, port, _ready))
        return
    shown = Logs.of(logs) if logs else Logs.of_machine(socket, captures)
    for why in shown.refused.values():
        say(f"motorctl: not shown: {why}", err=True)

    try:
        _run(serve(shown, address, port, _ready))
    finally:
        shown.close()


def _ready(url: str) -> None:
    say(f"{url}  (Ctrl-C ends)")


def _run(served: Coroutine[Any, Any, None]) -> None:
    with suppress(KeyboardInterrupt):
        asyncio.run(served)
