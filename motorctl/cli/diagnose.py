"""`motorctl diagnose`: find what the declared model lacks."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli.recording_argument import AllowCode, RecordingParts, WholeRun
from motorctl.cli.say import say
from motorctl.cli.terminal import Terminal

EXAMPLE = (
    "Example: motorctl diagnose run.parquet --out report    or: "
    "motorctl diagnose emps.yaml --evaluate pulses.yaml --out report"
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
    from motorctl.cli.progress import showing_stages
    from motorctl.config.chosen_code import allowed_by
    from motorctl.identify.columns.measured import read_measured
    from motorctl.identify.diagnose.recording import diagnose_recording
    from motorctl.identify.diagnose.report.json_document import diagnosis_document
    from motorctl.identify.diagnose.report.next_steps import next_steps, write_programs
    from motorctl.identify.diagnose.report.page import write_report
    from motorctl.identify.diagnose.report.terminal import print_diagnosis
    from motorctl.identify.fit.declared_models import (
        declared_models,
        is_file,
        machine_of,
        untried_effects,
    )
    from motorctl.identify.same_axis import check_belongs, declared_inertias
    from motorctl.model.catalog import failed_effects

    may_run = allowed_by(allow_code or ())
    config = model if is_file(model) else None
    with showing_stages() as progress:
        progress("reading", 0.0)
        read = read_measured(recording, whole_run=whole_run)
        test = None if evaluate is None else read_measured(evaluate)
        machine = machine_of(read, model, may_run)
        models = declared_models(read, model, axis, may_run, machine)
        if machine is not None:
            check_belongs(read, machine, models)
        further = [] if machine is None else list(machine.further_effects.values())
        inertia = declared_inertias(read, machine, models)
        found = diagnose_recording(read, models, progress, test, further, inertia)
        untried = [f"{name} was not tried: {why}" for name, why in failed_effects().items()]
        if config is None:
            untried += [
                f"{name} was not tried, though the log's configuration names it: allow its module "
                "with --allow-code"
                for name in untried_effects(read, machine)
            ]
        found = replace(found, notes=(*found.notes, *untried))
        programs, files = {}, []
        if out is not None:
            progress("drawing", 1.0)
            programs = write_programs(found, out)
        steps = next_steps(found, config, programs)
        if out is not None:
            files = write_report(out, found, steps=steps)
            files += [path for paths in programs.values() for path in paths if path is not None]
    if as_json:
        say(json.dumps(diagnosis_document(found) | {"files": [str(path) for path in files]}))
        return
    console = Terminal()
    print_diagnosis(console, found, steps)
    for path in files:
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)
