"""`motorctl refine`: diagnose a recording and write what was found into a configuration."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.recording_argument import RecordingParts, WholeRun
from motorctl.cli.say import say

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.identify.diagnose.result import RecordingDiagnosis
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
        str, typer.Option(help="The configuration to refine: a file, or a shipped one's name.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="NEW.yaml", help="The refined configuration to write.")
    ],
    axis: Annotated[str | None, typer.Option(help="This axis only.")] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where the diagnosis' report goes.")
    ] = None,
    whole_run: WholeRun = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Diagnose a recording; write a configuration with the effects that its model lacks.

    The text of CONFIG is kept but for the models of the axes concerned: effects are added,
    parameters, bounds and covariances come from the data. NEW.yaml is loaded before it is put in
    place. Where nothing is missing, parameters change only if that is an improvement.
    """
    from motorctl.cli.progress import showing_stages
    from motorctl.errors import UsageError
    from motorctl.identify.columns.measured import read_measured
    from motorctl.identify.diagnose.recording import diagnose_recording
    from motorctl.identify.diagnose.report.page import write_report
    from motorctl.identify.refine.json_document import refinement_document
    from motorctl.identify.refine.refinement import load_machine, refine_config
    from motorctl.identify.same_axis import declared_inertias, require_same_machine

    if not out.parent.is_dir():
        raise UsageError(f"{out}: there is no folder {out.parent}")
    if out.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(f"{out}: a configuration is a .yaml file")
    machine, _ = load_machine(config)
    with showing_stages() as progress:
        progress("reading", 0.0)
        read = read_measured(recording, whole_run=whole_run)
        names = list(read.axes) if axis is None else [axis]
        require_same_machine(read, machine, names)
        models = {name: machine.axes[name].declared for name in names}
        diagnosis = diagnose_recording(
            read,
            models,
            progress,
            further=list(machine.further_effects.values()),
            inertia=declared_inertias(read, machine, names),
        )
        progress("refining", 1.0)
        refinement = refine_config(diagnosis, machine.source, out)
    refinement.write()
    commands = _commands(config, refinement)
    written = []
    if report is not None:
        written = write_report(report, diagnosis, config_change=refinement.diff, commands=commands)
    if as_json:
        say(json.dumps(refinement_document(diagnosis, refinement, machine, written)))
        return
    _print(diagnosis, refinement)
    for path in written[:1]:
        say(path)
    say("next")
    for command in commands:
        say(f"  {command}")


def _print(diagnosis: RecordingDiagnosis, refinement: Refinement) -> None:
    from rich.markup import escape
    from rich.syntax import Syntax

    from motorctl.cli.terminal import Terminal
    from motorctl.identify.refine.header import error_words

    console = Terminal(highlight=False)
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


def _commands(config: str, refinement: Refinement) -> list[str]:
    """Return what to run next: before and after on the same motion, simulated where possible."""
    out = shlex.quote(str(refinement.out))
    simulated = refinement.machine.drivers and all(
        driver.cls.supports_virtual_time for driver in refinement.machine.drivers.values()
    )
    if not simulated:
        return [f"motorctl check {out}", f"motorctl run {out}"]
    before = shlex.quote(config)
    stem = refinement.out.stem
    logs = [shlex.quote(f"{stem}_{when}.parquet") for when in ("before", "after")]
    return [
        f"motorctl check {out}",
        *([f"motorctl simulate {before} --log {logs[0]}"] if before != out else []),
        f"motorctl simulate {out} --log {logs[1]}",
        f"motorctl compare {' '.join(logs)}",
    ]
