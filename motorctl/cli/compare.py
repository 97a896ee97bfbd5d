"""`motorctl compare`: before and after, by the published measures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.recording_argument import WholeRun
from motorctl.cli.say import say


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("compare", epilog="Example: motorctl compare c1.parquet c2.parquet --out pictures")(
        _compare
    )


def _compare(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING…", help="Logs, foreign recordings, or folders and names of runs."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where pictures go; none without it.")
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="The motion's period, where neither log nor motion shows it."
        ),
    ] = None,
    whole_run: WholeRun = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Measure every recording: eM, eF, L2[e], uM, and the first one's ratio to each other."""
    from motorctl import compare
    from motorctl.cli.measure_tables import print_comparison
    from motorctl.cli.progress import showing_progress
    from motorctl.identify.compare.pictures import plot_comparison

    with showing_progress("reading the recordings") as progress:
        comparison = compare(*recordings, period_s=period, whole_run=whole_run, progress=progress)
    pictures = plot_comparison(comparison, out) if out else []
    if as_json:
        say(json.dumps(comparison.to_dict() | {"pictures": [str(p) for p in pictures]}))
        return
    print_comparison(comparison)
    for picture in pictures:
        say(picture)
