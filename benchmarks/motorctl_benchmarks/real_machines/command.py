"""`motorctl bench recordings`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, EachCase, Workers


def recordings(
    folder: Annotated[
        Path | None,
        typer.Option(
            "--recordings",
            metavar="DIR",
            envvar="MOTORCTL_RECORDINGS",
            help="Where tools/fetch_recordings.py has put them.",
        ),
    ] = None,
    workers: Workers = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="AXIS", help="The axis of this name alone; may be repeated."),
    ] = None,
    out: EachCase = None,
    as_json: AsJson = False,
) -> None:
    """Predict the position of real machines, beside PySINDy and SysIdentPy if installed."""
    from motorctl_benchmarks.print_result import measure_and_print
    from motorctl_benchmarks.real_machines.findings import RecordingsOptions, recordings_findings

    options = RecordingsOptions(folder, workers, out, tuple(only or ()))
    measure_and_print("recordings", partial(recordings_findings, options=options), as_json=as_json)
