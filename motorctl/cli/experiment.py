"""`motorctl experiment`: which motion would tell most, given what a recording leaves open."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.config_argument import ConfigArgument
from motorctl.cli.say import say

if TYPE_CHECKING:
    from motorctl.experiment.session import Experiment, Standing
    from motorctl.identify.diagnose.report.motion_advice import Reach

SHOWN = 8


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "experiment",
        epilog="Example: motorctl experiment published_gantry --recording run.parquet --out next",
    )(_experiment)


def _experiment(
    config: ConfigArgument,
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="What was recorded so far; several in order of time, of one run. Without: the "
            "motion to begin with.",
        ),
    ] = None,
    axis: Annotated[str | None, typer.Option(help="Ask about this axis only.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where programs and pictures go; else none.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Choose the most telling motion: weigh candidates by what is still open. Nothing moves.

    The recording is diagnosed; what it leaves open is asked of some thirty short motions within the
    reach of the axis' own programs, and within axes.NAME.experiments where that is declared. What
    no motion can settle is said to be inseparable, with the reason.
    """
    from motorctl.cli.progress import showing_stages
    from motorctl.config import load
    from motorctl.errors import UsageError
    from motorctl.experiment.candidates import probe
    from motorctl.experiment.document import standing_document
    from motorctl.experiment.picture import draw_outlook
    from motorctl.experiment.reach import reach_in_envelope
    from motorctl.experiment.session import Experiment, Standing, next_experiment, standing
    from motorctl.identify.diagnose.recording import diagnose_recording
    from motorctl.identify.fit.declared_models import declared_models
    from motorctl.identify.same_axis import check_belongs, declared_inertias
    from motorctl.log import read_recording
    from motorctl.log.joined import joined

    machine = load(config)
    reaches = {name: reach_in_envelope(machine, each) for name, each in machine.axes.items()}
    if axis is not None and axis not in reaches:
        raise UsageError(f"{machine.source}: no axis '{axis}'; it has: {', '.join(reaches)}")
    first = probe(reaches)
    now, sentences = Standing({}, tuple(reaches)), dict[str, str]()
    chosen: Experiment | None = Experiment(first, first.lasts_s(reaches), ("what is there at all",))
    if recording:
        with showing_stages() as progress:
            progress("reading", 0.0)
            read = joined([read_recording(path, gaps="keep") for path in recording])
            models = declared_models(read, config, axis)
            check_belongs(read, machine, models)
            further = list(machine.further_effects.values())
            inertia = declared_inertias(read, machine, models)
            found = diagnose_recording(read, models, progress, None, further, inertia)
            sentences = {name: each.sentence for name, each in found.axes.items()}
            sentences |= {name: f"not diagnosed: {why}" for name, why in found.refused.items()}
            progress("weighing motions", 1.0)
            now = standing(found, reaches, further, list(models))
            chosen = None if now.settled else next_experiment(now, reaches, first)
    files = [] if out is None or chosen is None else _programs(chosen, reaches, out)
    if out is not None and chosen is not None:
        for name, look in now.outlooks.items():
            if look.best is not None:
                picture = out / f"experiment_{name}.png"
                files.append(str(draw_outlook(look, chosen, reaches, picture)))
    if as_json:
        say(json.dumps(standing_document(now, chosen) | {"files": files}))
        return
    for name, sentence in sentences.items():
        say(f"axis {name}: {sentence}")
    _print(now, chosen)
    for file in files:
        say(file)


def _programs(chosen: Experiment, reaches: Mapping[str, Reach], out: Path) -> list[str]:
    """Write the chosen motion as a program file for each axis that it moves."""
    import yaml

    from motorctl.errors import UsageError

    files = []
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in chosen.candidate.strokes:
            path = out / f"experiment_{name}.yaml"
            keys = yaml.safe_dump(chosen.candidate.program(name, reaches[name]), sort_keys=False)
            words = [chosen.candidate.words, *(f"It settles: {each}" for each in chosen.settles)]
            comment = "".join(f"# {line}\n" for line in words)
            path.write_text(comment + keys, encoding="utf-8")
            files.append(str(path))
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror}") from error
    return files


def _print(now: Standing, chosen: Experiment | None) -> None:
    from rich.markup import escape
    from rich.table import Table

    from motorctl.cli.terminal import Terminal
    from motorctl.experiment.outlook import what_it_settles

    console = Terminal()
    for name, look in now.outlooks.items():
        questions = [q for q in look.open.questions if q.words not in look.lost]
        if not questions:
            continue
        say(f"axis {name}, still open: {'; '.join(question.words for question in questions)}")
        table = Table("motion", "s", "settled/s", "what it is expected to settle")
        for prospect in look.prospects[:SHOWN]:
            told = what_it_settles(prospect, look.open.questions)
            cells = (f"{prospect.duration_s:.1f}", f"{prospect.rate:.2f}", escape(told))
            table.add_row(escape(prospect.candidate.words), *cells)
        console.print(table)
        more = len(look.prospects) - SHOWN
        if more > 0:
            say(f"and {more} motions that tell less; --json has all")
    for each in now.inseparable:
        say(each.words)
    if chosen is None:
        say(
            "nothing is left that a motion within the envelope could settle"
            if now.settled
            else "no motion within the envelope is expected to settle much of what is left"
        )
        return
    say(f"next: {chosen.candidate.words}, {chosen.duration_s:.1f} s")
    for words in chosen.settles:
        say(f"  {words}")
