"""`motorctl scope`: logs in the browser."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.say import say
from motorctl.errors import UsageError


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("scope", epilog="Example: motorctl scope before.parquet after.parquet")(_scope)


def _scope(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="Logs, unfinished ones, or foreign recordings; several are shown side by side.",
            show_default=False,
        ),
    ],
    port: Annotated[int, typer.Option(help="The page's port; 0: any that is free.")] = 0,
    address: Annotated[
        str,
        typer.Option(help="Where the page is served; any but 127.0.0.1 asks for a token."),
    ] = "127.0.0.1",
) -> None:
    """Show logs in a browser: from the whole recording down to single rows."""
    try:
        import aiohttp  # noqa: F401
    except ImportError:
        raise UsageError(
            "motorctl scope needs aiohttp, which is not installed: pip install 'motorctl[scope]'"
        ) from None
    from motorctl.scope.server import Logs, serve

    opened = Logs.of(logs)
    for why in opened.refused.values():
        say(f"motorctl: not shown: {why}", err=True)

    def ready(url: str) -> None:
        say(f"{url}  (Ctrl-C ends)")

    with suppress(KeyboardInterrupt):
        asyncio.run(serve(opened, address, port, ready))
