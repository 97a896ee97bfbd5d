"""`motorctl refine`: diagnose a recording and write what was found into a configuration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.completion import configurations
from motorctl.cli.force_option import ForceOption
from motorctl.cli.recording_argument import RecordingParts, WholeRun
from motorctl.cli.say import say

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.identify.refine.refinement import Refinement


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "refine",
        epilog="Example: motorctl refine run.parquet --config published_gantry --out refined.yaml",
    )(_refine)


def _refine(
    recording: RecordingParts,
    config: Annotated[
        str,
        typer.Option(
            help="The configuration to refine: a file, or a shipped one's name.",
            autocompletion=configurations,
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="NEW.yaml", help="The refined configuration to write.")
    ],
    axis: Annotated[str | None, typer.Option(help="This axis only.")] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where the diagnosis' report goes.")
    ] = None,
    whole_run: WholeRun = False,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Diagnose a recording; write a configuration with the effects that its model lacks.

    The text of CONFIG is kept but for the models of the axes concerned: effects are added,
    parameters, bounds and covariances come from the data. NEW.yaml is loaded before it is put in
    place. Where nothing is missing, parameters change only if that is an improvement.
    """
    from motorctl import refine
    from motorctl.cli.progress import showing_stages
    from motorctl.identify.diagnose.report.page import write_report
    from motorctl.replacing import is_in_place, refuse_what_is_there

    refuse_what_is_there(out, replace=force or is_in_place(out, config))
    with showing_stages() as progress:
        refinement = refine(
            recording, config, out, axis=axis, whole_run=whole_run, progress=progress
        )
    commands = refinement.next_commands(config)
    files = []
    if report is not None:
        change = refinement.diff
        files = write_report(report, refinement.diagnosis, config_change=change, commands=commands)
    if as_json:
        say(json.dumps(refinement.to_dict() | {"report": [str(path) for path in files]}))
        return
    _print(refinement)
    for path in files[:1]:
        say(path)
    say("next")
    for command in commands:
        say(f"  {command}")


def _print(refinement: Refinement) -> None:
    from rich.markup import escape
    from rich.syntax import Syntax

    from motorctl.cli.terminal import Terminal
    from motorctl.identify.refine.header import error_words

    console = Terminal(highlight=False)
    diagnosis = refinement.diagnosis
    for name, axis in refinement.axes.items():
        console.print(f"[bold]axis {escape(name)}[/bold]")
        for words in (*axis.done, *(error_words(diagnosis.axes[name]) if axis.changed else ())):
            console.print(f"  {escape(words)}", soft_wrap=True)
    for name, why in diagnosis.refused.items():
        console.print(f"axis {escape(name)} was not diagnosed: {escape(why)}", soft_wrap=True)
    if console.is_terminal:
        console.print(Syntax(refinement.diff, "diff", background_color="default"))
    else:
        say(refinement.diff)
    say(refinement.out)
