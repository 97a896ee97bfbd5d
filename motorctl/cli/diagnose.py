"""`motorctl diagnose`: find what the declared model lacks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.recording_argument import AllowCode, RecordingParts, WholeRun
from motorctl.cli.say import say
from motorctl.cli.terminal import Terminal

EXAMPLE = (
    "Example: motorctl diagnose run.parquet --out report\n\n"
    "Example: motorctl diagnose emps.yaml --evaluate pulses.yaml --out report"
)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("diagnose", epilog=EXAMPLE)(_diagnose)


def _diagnose(
    recording: RecordingParts,
    model: Annotated[
        str | None,
        typer.Option(help="C1, C2 or a configuration; else what the log declares, or C1."),
    ] = None,
    axis: Annotated[str | None, typer.Option(help="This axis only.")] = None,
    evaluate: Annotated[
        Path | None,
        typer.Option(
            metavar="RECORDING", help="A second recording, on which the errors are measured."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where report, pictures and programs go; else none."),
    ] = None,
    whole_run: WholeRun = False,
    allow_code: AllowCode = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Trace what the declared model leaves to its cause: verdict, effects, evidence, report."""
    from motorctl import diagnose
    from motorctl.cli.progress import showing_stages
    from motorctl.identify.diagnose.report.terminal import print_diagnosis
    from motorctl.identify.diagnose.report.written import write_diagnosis
    from motorctl.identify.fit.declared_models import is_file

    with showing_stages() as progress:
        found = diagnose(
            recording,
            model=model,
            axis=axis,
            evaluate=evaluate,
            whole_run=whole_run,
            allow_code=allow_code or (),
            progress=progress,
        )
        if out is not None:
            progress("drawing", 1.0)
        steps, files = write_diagnosis(found, out, model if is_file(model) else None)
    if as_json:
        say(json.dumps(found.to_dict() | {"files": [str(path) for path in files]}))
        return
    console = Terminal()
    print_diagnosis(console, found, steps)
    for path in files:
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)
