"""`motorctl fleet`: the logs of many machines and days, and what changed."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.recording_argument import AllowCode
from motorctl.cli.say import say
from motorctl.cli.whole_help import WholeHelp
from motorctl.errors import UsageError

if TYPE_CHECKING:
    from motorctl.fleet.run import FleetRun

NEEDED = ("distributed", "fsspec", "ruptures")
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
StoreOption = Annotated[
    Path, typer.Option("--store", metavar="DIR", help="The folder of findings.", show_default=False)
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=WholeHelp, no_args_is_help=True)
    group.command(
        "diagnose",
        epilog="Example: motorctl fleet diagnose 'logs/**/*.parquet' --store findings",
    )(_diagnose)
    app.add_typer(
        group, name="fleet", help="Diagnose the logs of many machines and days, and keep findings."
    )


def _diagnose(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOGS...",
            help="Logs, or quoted patterns of them; s3://…, gs://… and http://… where the package "
            "for it is installed.",
            show_default=False,
        ),
    ],
    store: StoreOption,
    model: Annotated[
        str | None,
        typer.Option(help="C1, C2 or a configuration; else what each log declares."),
    ] = None,
    diagnoses: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="So many windows of each axis and log are searched for what the model lacks; "
            "every one is fitted.",
        ),
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://…", help="Of a Dask cluster; else one of this computer."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes of this computer; else one a CPU."),
    ] = None,
    allow_code: AllowCode = None,
    as_json: AsJson = False,
) -> None:
    """Fit and diagnose every log that was not looked at before; exit with 1 where some cannot be.

    A bad log is told with its file and the reason, and the others go on. What is done stays,
    whatever ends the run: the same command again does the rest.
    """
    _require_extra()
    from motorctl.cli.progress import showing_stages
    from motorctl.fleet.run import diagnose_fleet

    with showing_stages(lines=True) as progress:
        run = diagnose_fleet(
            logs,
            store,
            model=model,
            allow_code=allow_code or (),
            diagnoses=diagnoses,
            scheduler=scheduler,
            workers=workers,
            progress=progress,
        )
    if as_json:
        say(json.dumps(run.to_dict()))
    else:
        for refusal in run.refused:
            say(f"motorctl: not looked at: {refusal.reason}", err=True)
        say(_summary(run))
    if run.refused:
        raise typer.Exit(2 if len(run.refused) == run.logs else 1)


def _summary(run: FleetRun) -> str:
    twins = f", {run.twins} the same as another" if run.twins else ""
    return (
        f"{run.store}: of {run.logs} logs {run.looked_at} were looked at ({run.hours:.3g} h of "
        f"recording in {run.seconds:.3g} s), {run.known} were known{twins}, {len(run.refused)} "
        f"cannot be used; {run.findings} findings were added"
    )


def _require_extra() -> None:
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise UsageError(
            f"motorctl fleet needs {', '.join(missing)}, not installed: pip install "
            "'motorctl[fleet]'"
        )
