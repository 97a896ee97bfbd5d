"""`motorctl latency`: wake-up latency and turnaround of this machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.completion import configurations
from motorctl.cli.say import say


def latency(
    duration: Annotated[
        float, typer.Option(metavar="S", help="Seconds that the loop runs.")
    ] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
    log: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Keep the log of every tick.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Write latency.png and latency.json there.", show_default=False
        ),
    ] = None,
    config: Annotated[
        str,
        typer.Option(
            metavar="CONFIG",
            help="A YAML file, or a shipped one's name.",
            autocompletion=configurations,
        ),
    ] = "published_gantry",
    cyclictest: Annotated[
        bool, typer.Option(help="Measure cyclictest before and after, where it is installed.")
    ] = True,
    move: Annotated[
        bool, typer.Option("--move", help="Start the axes of real devices too: they move!")
    ] = False,
) -> None:
    """Measure wake-up latency and turnaround of the real loop process on this machine.

    Simulated axes follow their programs; axes of real devices stay off without --move.
    Histograms, percentiles and the worst case, beside cyclictest's, and a plain verdict. The
    exit status is 0 whatever the verdict.

    Example: motorctl latency --duration 10 --out latency
    """

    from motorctl.cli.progress import showing_progress
    from motorctl.cli.terminal import Terminal
    from motorctl.config import load
    from motorctl.latency import LatencyOptions, measure_latency
    from motorctl.latency.view import print_latency

    options = LatencyOptions(duration, log, out, beside_cyclictest=cyclictest, move_devices=move)
    with showing_progress("measuring; the first run compiles the kernels") as progress:
        result = measure_latency(load(config), options, progress)
    if as_json:
        say(json.dumps(result.document(), indent=2))
    else:
        print_latency(Terminal(), result)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(latency)
