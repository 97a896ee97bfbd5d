"""`motorctl learn`: a feedforward that an axis learns by repeating its program."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.recording_argument import WholeRun
from motorctl.cli.response_option import response_from
from motorctl.cli.say import say

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.close_loop.rigs import Rig
    from motorctl.config import Machine
    from motorctl.learn.learning import Learning
    from motorctl.response.measurement import Measurement


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("learn", epilog="Example: motorctl learn x --config gantry.yaml --report pictures")(
        _learn
    )


def _learn(
    axis: Annotated[str, typer.Argument(help="The axis that learns.")],
    config: Annotated[
        str,
        typer.Option(
            help="Its configuration; `axes.NAME.learning` there names the file of what it learns."
        ),
    ],
    socket: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="On the machine that this daemon runs; else in virtual time."
        ),
    ] = None,
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="Move nothing: learn from a log of the axis following its program.",
        ),
    ] = None,
    whole_run: WholeRun = False,
    response: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="Log of `motorctl response` of this axis: tells how high can be learned, instead "
            "of the fitted plant and the parameters' bounds.",
        ),
    ] = None,
    repetitions: Annotated[
        int, typer.Option(min=2, max=50, help="Runs of the program at most.")
    ] = 6,
    anew: Annotated[
        bool, typer.Option("--anew", help="Begin from nothing, whatever was learned before.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where the picture and the logs go.")
    ] = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="With --socket: do not ask before each run; only where the machine is simulated, "
            "or within what axes.NAME.experiments allows.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Learn a voltage by place in a program that repeats: what no effect of the model explains.

    The program is run again and again; what each run repeats of its error is turned into a voltage
    for the next, through a filter that keeps every plant within the parameters' bounds from being
    driven away. The best is kept, in the file that the configuration names.
    """
    from motorctl.cli.progress import showing_stages
    from motorctl.config import load
    from motorctl.errors import UsageError
    from motorctl.learn.document import learning_document
    from motorctl.learn.learning import require_learning
    from motorctl.learn.picture import draw_learning

    if recording and socket:
        raise UsageError("--recording and --socket: name one of them: a log, or a machine")
    machine = load(config, hardware=not recording)
    _, _, path = require_learning(machine, axis)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) if report is None else report
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{folder}: cannot be written: {error.strerror}") from error
        with showing_stages(lines=True, bar=socket is None) as progress:
            measured = response_from(response, machine, axis, progress)
            wanted = _Wanted(machine, axis, folder, repetitions, anew, measured, progress)
            if recording:
                learning = wanted.from_log(recording, path, whole_run=whole_run)
            elif socket is not None:
                learning = wanted.through_daemon(socket, path, yes=yes)
            else:
                learning = wanted.in_virtual_time(path, Path(scratch))
            picture = None
            if report is not None:
                progress("drawing", 0.0)
                picture = draw_learning(learning, report / f"learning_{axis}.png")
    files = [str(path), *([] if picture is None else [str(picture)])]
    if as_json:
        say(json.dumps(learning_document(learning) | {"files": files}))
        return
    _print(learning)
    for file in files:
        say(file)


@dataclass(frozen=True)
class _Wanted:
    """What was asked for."""

    machine: Machine
    axis: str
    folder: Path
    """Of the logs."""
    repetitions: int
    anew: bool
    measured: Measurement | None
    progress: Callable[[str, float], None]

    def from_log(self, logs: list[Path], path: Path, *, whole_run: bool) -> Learning:
        """Learn from a log; nothing moves."""
        from motorctl.learn.learning import learn_from_log
        from motorctl.log import read_recording

        self.progress("learning from the log", 0.0)
        recording = read_recording(list(logs), gaps="keep", whole_run=whole_run)
        return learn_from_log(
            recording, self.machine, self.axis, path, anew=self.anew, measured=self.measured
        )

    def in_virtual_time(self, path: Path, scratch: Path) -> Learning:
        """Repeat the program in virtual time; the file is written once, at the end."""
        from motorctl.close_loop.rigs import SimulatedRig
        from motorctl.config.learned_file import read_learned, write_learned
        from motorctl.learn.learning import with_place

        place = scratch / path.name
        for name, entry in read_learned(path).items():
            write_learned(place, name, entry)
        machine = with_place(self.machine, self.axis, place)
        learning = self._repeated(machine, SimulatedRig(), place)
        write_learned(path, learning.program, read_learned(place)[learning.program])
        return learning

    def through_daemon(self, socket: Path, path: Path, *, yes: bool) -> Learning:
        """Repeat the program on the machine that a daemon runs, once somebody has said yes."""
        from motorctl.cli.consent import Consents
        from motorctl.close_loop.machine_rig import MachineRig
        from motorctl.daemon.client import Client
        from motorctl.daemon.running_machine import ended_in_order, machine_of_daemon
        from motorctl.learn.what_is_added import require_same_file

        with ended_in_order(), Client(socket) as client:
            rig = MachineRig(client, machine_of_daemon(client), Consents(yes=yes).ask)
            rig.insist(self.machine)
            require_same_file(self.machine, self.axis, path, client.ask("status"))
            return self._repeated(self.machine, rig, path)

    def _repeated(self, machine: Machine, rig: Rig, place: Path) -> Learning:
        from motorctl.learn.learning import learn_by_repeating

        return learn_by_repeating(
            machine,
            self.axis,
            rig,
            place,
            self.folder,
            repetitions=self.repetitions,
            anew=self.anew,
            measured=self.measured,
            progress=self.progress,
        )


def _print(learning: Learning) -> None:
    """Print the repetitions as a table, and what they rest on."""
    from motorctl.cli.terminal import print_axis
    from motorctl.learn.rows import headings, rows, words

    print_axis(learning.axis, headings(learning), rows(learning), words(learning))
