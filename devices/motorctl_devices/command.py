"""`motorctl gantry-device`: the simulated gantry behind a bus, in a process of its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer


def gantry_device(
    device: Annotated[
        Path,
        typer.Argument(
            metavar="DEVICE", help="A YAML file of a device, or the name of a shipped one."
        ),
    ],
    link: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="Make a symbolic link to its serial port.", show_default=False
        ),
    ] = None,
    raise_workers: Annotated[
        bool,
        typer.Option(
            "--raise-workers",
            help="Give the kernel's threads that carry pseudo-terminals a real-time priority "
            "while the device runs, so that answers are not late on a busy machine. Takes root.",
        ),
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="At the end, one JSON line on stdout; the endpoint is told on stderr."
        ),
    ] = False,
) -> None:
    """Serve the simulated gantry over a bus, with faults to order.

    One line tells the endpoint when it is ready; SIGTERM or Ctrl-C ends it.

    Example: motorctl gantry-device serial_box --link /tmp/motorctl-box
    """
    from motorctl.cli.say import say
    from motorctl_devices import run_device

    def ready(endpoint: str) -> None:
        say(f"ready: {endpoint}", err=as_json)

    told = run_device(device, link, ready, raise_workers=raise_workers)
    if as_json:
        say(json.dumps(told))
