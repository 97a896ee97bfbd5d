"""`motorctl simulate`: the same loop in virtual time, as fast as it goes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.choices import ControllerChoice
from motorctl.cli.config_argument import ConfigArgument
from motorctl.cli.force_option import ForceOption
from motorctl.cli.say import say


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "simulate",
        epilog="Example: motorctl simulate published_gantry --controller C1 --log c1.parquet",
    )(_simulate)


def _simulate(
    config: ConfigArgument,
    log: Annotated[Path, typer.Option(help="The log to write, a Parquet file.")],
    controller: Annotated[
        ControllerChoice | None, typer.Option(help="In place of what the axes say.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds; else until the programs end.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="In place of the drivers' own seeds.")] = None,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Start every axis in virtual time, follow its program, log every tick.

    Two runs with the same configuration and seed give the same rows, bit for bit.
    """
    from motorctl import compare, simulate
    from motorctl.cli.progress import showing_progress
    from motorctl.identify.compare.measures import (
        measured_document,
        table_cells,
        table_headings,
    )
    from motorctl.replacing import refuse_what_is_there

    refuse_what_is_there(log, replace=force)
    with showing_progress("simulating; the first run compiles the kernels") as progress:
        recorded = simulate(
            config,
            log,
            controller=None if controller is None else controller.value,
            duration_s=duration,
            seed=seed,
            progress=progress,
        )
        comparison = compare(recorded)
    measured = comparison.runs[0].axes
    took = recorded.metadata["virtual_time"]
    times_real_time = recorded.duration_s / took["wall_s"]
    for note in recorded.metadata.get("notes", ()):
        say(note, err=True)
    if as_json:
        document = {
            "log": str(log),
            "duration_s": recorded.duration_s,
            "wall_s": took["wall_s"],
            "times_real_time": times_real_time,
            "turnaround": took["turnaround"],
            "axes": {
                name: measured_document(run, *comparison.units(name))
                for name, run in measured.items()
            },
        }
        say(json.dumps(document))
        return
    say(
        f"{log}: {recorded.duration_s:.1f} s in {took['wall_s']:.1f} s, "
        f"{times_real_time:.1f} times real time"
    )
    for name, run in measured.items():
        values = zip(
            table_headings(*comparison.units(name)), table_cells(run.measures), strict=True
        )
        say(f"  {name}: " + ", ".join(f"{label} {value}" for label, value in values))
