"""`motorctl tune`: gains of least error at the margins that are asked for."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.completion import configurations
from motorctl.cli.force_option import ForceOption
from motorctl.cli.recording_argument import WholeRun
from motorctl.cli.response_option import response_from
from motorctl.cli.say import say

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.tune.tuning import Tuning


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "tune",
        epilog="Example: motorctl tune x --config refined.yaml --recording run.parquet "
        "--margin 30deg,6dB --out tuned.yaml",
    )(_tune)


def _tune(
    axis: Annotated[str, typer.Argument(help="The axis whose gains are chosen.")],
    config: Annotated[
        str,
        typer.Option(
            help="The configuration to tune: a file, or a shipped one's name.",
            autocompletion=configurations,
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="NEW.yaml", help="The tuned configuration to write.")
    ],
    margin: Annotated[
        str, typer.Option(metavar="DEG,DB", help="Phase and gain margin that the loop must keep.")
    ] = "30deg,6dB",
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="A log of the axis following its program with CONFIG; else it is simulated, where "
            "the driver supports virtual time.",
        ),
    ] = None,
    command_noise: Annotated[
        float | None,
        typer.Option(
            metavar="V",
            help="Noise of the command at rest that the amplifier may see, rms; else 5 % of the "
            "axis' voltage limit.",
        ),
    ] = None,
    whole_run: WholeRun = False,
    force: ForceOption = False,
    response: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="Log of `motorctl response` of this axis: margins are those around the plant that "
            "was measured, less its errors, instead of around one that is fitted to the program.",
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where the picture and the logs go.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Choose k1, ks and gamma_d: least error over the program, at margins that are asked for.

    Inertia, friction and delay are fitted to the log, or measured (--response). The loop is stable
    at every corner of the parameters' bounds. Where the program is simulated, the gains are tried
    out before they are written.
    """
    from motorctl.cli.progress import showing_stages
    from motorctl.errors import UsageError
    from motorctl.identify.refine.refinement import load_machine
    from motorctl.identify.refine.written_beside import put_in_place
    from motorctl.log import read_recording
    from motorctl.replacing import is_in_place, refuse_what_is_there
    from motorctl.tune.document import tuning_document
    from motorctl.tune.margins_wanted import margins_wanted
    from motorctl.tune.picture import draw_tuning
    from motorctl.tune.tuning import record_program, require_tunable, try_out, tune, write_beside

    wanted = margins_wanted(margin, command_noise)
    if not out.parent.is_dir():
        raise UsageError(f"{out}: there is no folder {out.parent}")
    if out.suffix.lower() not in (".yaml", ".yml") or out.is_dir():
        raise UsageError(f"{out}: a configuration is a .yaml file")
    refuse_what_is_there(out, replace=force or is_in_place(out, config))
    machine, hardware = load_machine(config)
    require_tunable(machine, axis, out, hardware=hardware)
    with tempfile.TemporaryDirectory() as scratch, showing_stages(lines=True) as progress:
        folder = Path(scratch) if report is None else report
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{folder}: cannot be written: {error.strerror}") from error
        measured = response_from(response, machine, axis, progress)
        if recording:
            read = read_recording(recording, gaps="keep", whole_run=whole_run)
        else:
            read = record_program(machine, axis, folder / f"tuning_{axis}_before.parquet", progress)
        tuning = tune(read, machine, axis, wanted, progress, measured)
        beside = write_beside(machine, axis, tuning.gains, out, hardware=hardware)
        try:
            if not recording:
                log = folder / f"tuning_{axis}_after.parquet"
                tuning = try_out(tuning, beside, log, progress)
            picture = None if report is None else draw_tuning(tuning, report / f"tuning_{axis}.png")
        except BaseException:
            beside.unlink()
            raise
        put_in_place(beside, out)
    if as_json:
        files = [str(out), *([] if picture is None else [str(picture)])]
        say(json.dumps(tuning_document(tuning) | {"files": files}))
        return
    _print(tuning)
    say(f"{out}" + ("" if picture is None else f"\n{picture}"))
    if recording:
        say(
            f"next: motorctl run {out}, record the program again, and motorctl compare the two logs"
        )


def _print(tuning: Tuning) -> None:
    """Print the gains, margins and errors as a table, and what they rest on."""
    from motorctl.cli.terminal import print_axis
    from motorctl.tune.rows import footnotes, rows

    headings = ("before", "tuned")
    print_axis(tuning.loop.axis, headings, rows(tuning), footnotes(tuning))
