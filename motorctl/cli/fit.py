"""`motorctl fit`: identify the declared model from a recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.recording_argument import AllowCode, RecordingParts, WholeRun
from motorctl.cli.say import say
from motorctl.cli.terminal import Terminal

EXAMPLE = (
    "Example: motorctl fit run.parquet --model C2\n\n"
    "Example: motorctl fit emps.yaml --model C1 --settings janot2019 --evaluate pulses.yaml"
)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("fit", epilog=EXAMPLE)(_fit)


def _fit(
    recording: RecordingParts,
    model: Annotated[
        str | None,
        typer.Option(help="C1, C2 or a configuration; else what the log declares, or C1."),
    ] = None,
    axis: Annotated[str | None, typer.Option(help="This axis only.")] = None,
    evaluate: Annotated[
        Path | None,
        typer.Option(metavar="RECORDING", help="A second recording, for the held-out error."),
    ] = None,
    settings: Annotated[
        str | None,
        typer.Option(
            metavar="NAME-OR-FILE",
            help="How it is filtered and regressed: default, whose file tells every key; "
            "janot2019; or a YAML file with some of those keys.",
        ),
    ] = None,
    whole_run: WholeRun = False,
    allow_code: AllowCode = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Identify the declared model: parameters, standard errors, input delay and error."""
    from motorctl import fit
    from motorctl.cli.progress import showing_work
    from motorctl.identify.fit.report import print_fit

    with showing_work("reading") as progress:
        found = fit(
            recording,
            model=model,
            axis=axis,
            evaluate=evaluate,
            settings=settings,
            whole_run=whole_run,
            allow_code=allow_code or (),
            progress=progress,
        )
    if as_json:
        say(json.dumps(found.to_dict()))
    else:
        print_fit(Terminal(), found)
