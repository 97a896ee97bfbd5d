"""`motorctl stream`: a running machine, or a log, to a program that draws what comes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.errors import UsageError

if TYPE_CHECKING:
    from motorctl.api.samples import Samples


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "stream",
        epilog="Example: motorctl stream --plotjuggler udp://127.0.0.1\n\n"
        "Example: motorctl stream run.parquet --plotjuggler udp://127.0.0.1 --column 'x.*'",
    )(_stream)


def _stream(
    plotjuggler: Annotated[
        str,
        typer.Option(
            metavar="udp://HOST[:PORT]",
            help="Where PlotJuggler's UDP server listens; usual port: 9870.",
            show_default=False,
        ),
    ],
    log: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LOG]",
            help="Sent as if it came now. None: the machine that a daemon runs.",
            show_default=False,
        ),
    ] = None,
    socket: SocketOption = None,
    rate: Annotated[
        float,
        typer.Option(
            "--rate-hz",
            min=1.0,
            max=20000.0,
            help="Messages a second, at most; two have the least and the greatest value of all "
            "rows between them.",
        ),
    ] = 200.0,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN",
            help="Which columns, as x.position_m or 'x.*'; as often as needed. Else all.",
            show_default=False,
        ),
    ] = None,
    speed: Annotated[
        float,
        typer.Option(min=0.001, max=1000.0, help="Of a log: how many of its seconds in one."),
    ] = 1.0,
) -> None:
    """Send a running machine's samples, or a log's, to PlotJuggler: JSON over UDP.

    Times are those of the machine's clock, under 'timestamp'. Every row is looked at, and none is
    asked of the loop.
    """
    from motorctl import connect, open_log
    from motorctl.api.off_the_loop import keep_off_the_loop_of
    from motorctl.neighbours.plotjuggler import Destination
    from motorctl.neighbours.streaming import replay, send_samples

    if log is not None and socket is not None:
        raise UsageError("stream: name a log, or the socket of a running daemon, not both")
    patterns = column or []
    with Destination(plotjuggler) as destination:
        lost = 0
        with suppress(KeyboardInterrupt):
            if log is not None:
                replay(open_log(log), destination, rate, speed, patterns)
            else:
                with connect(socket) as machine:
                    status = machine.status()
                    heard = machine.subscribe()
                say("sending until the daemon ends, or Ctrl-C", err=True)
                try:
                    with heard:
                        begun = _once_begun(heard, lambda: keep_off_the_loop_of(heard.path))
                        send_samples(begun, destination, status.rate_hz, rate, patterns)
                finally:
                    lost = heard.lost
        say(_told(destination.sent, destination.unheard, lost, plotjuggler))


def _once_begun(heard: Iterable[Samples], then: Callable[[], None]) -> Iterator[Samples]:
    """Yield what is heard; `then` is called when there is something for the first time."""
    for count, samples in enumerate(heard):
        if not count:
            then()
        yield samples


def _told(sent: int, unheard: int, lost: int, url: str) -> str:
    told = f"{sent:,} messages sent to {url}"
    if lost:
        told += f"; {lost:,} rows were overwritten before they were read"
    if unheard:
        told += (
            f"; {unheard:,} were refused there: start PlotJuggler's UDP Server (Streaming) on that "
            "port before"
        )
    return told
