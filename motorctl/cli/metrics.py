"""`motorctl metrics`: a running machine to Prometheus."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.extras import require


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("metrics", epilog="Example: motorctl metrics --port 9790")(_metrics)


def _metrics(
    socket: SocketOption = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Of /metrics; 0: any that is free.")
    ] = 9790,
    address: Annotated[
        str,
        typer.Option(help="Where it listens; any but 127.0.0.1 asks for a token."),
    ] = "127.0.0.1",
    token_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Whoever asks has to send what is in it, as 'Authorization: Bearer …'.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Serve states, errors, timing and disk of a running machine to Prometheus.

    A process of its own, which asks the daemon for its status once a scrape; the daemon itself
    listens nowhere. While no daemon answers, motorctl_up is 0.
    """
    require("motorctl metrics", "metrics", "prometheus_client")
    from motorctl.neighbours.metrics_server import (
        Access,
        DaemonCollector,
        application,
        open_server,
        token_in,
    )
    from motorctl.own_names import name_to_ask

    access = Access(address, None if token_file is None else token_in(token_file))
    collector = DaemonCollector(socket, lambda told: say(f"motorctl: {told}", err=True))
    collector.begin()
    with open_server(address, port, application(collector, access)) as server:
        say(f"http://{name_to_ask(address)}:{server.server_port}/metrics  (Ctrl-C ends)")
        with suppress(KeyboardInterrupt):
            server.serve_forever()
