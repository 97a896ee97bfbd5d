"""`motorctl close-loop`: run, diagnose, refine and run again, until it is good."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motorctl.cli.config_argument import ConfigArgument
from motorctl.cli.say import say

if TYPE_CHECKING:  # takes long to import: the command does so when it runs
    from motorctl.cli.consent import Consents
    from motorctl.close_loop.machine_rig import MachineRig


class MotionChoice(StrEnum):
    """What is recorded for diagnosis."""

    OWN = "own"
    RICH = "rich"
    TELLING = "telling"


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("close-loop", epilog="Example: motorctl close-loop published_gantry --out closed")(
        _close_loop
    )


def _close_loop(
    config: ConfigArgument,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where every round is kept, and refined.yaml.")
    ] = Path("close-loop-out"),
    rounds: Annotated[int, typer.Option(min=1, max=20, help="At most so many rounds.")] = 4,
    motion: Annotated[
        MotionChoice | None,
        typer.Option(
            help="What is recorded for diagnosis: by default a rich motion, made within what the "
            "machine's own programs use; these programs themselves; or telling motions, each "
            "chosen by what is still open, until nothing is."
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Length of each simulated motion.")
    ] = None,
    socket: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="On the machine that this daemon runs; else in virtual time."
        ),
    ] = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="With --socket: do not ask before each motion; only where the machine is "
            "simulated, or within what axes.NAME.experiments allows.",
        ),
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what --out holds of a run that broke off.")
    ] = False,
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Begin anew where --out holds recordings of a machine: all that an earlier run "
            "left there is removed, these recordings too.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Go round: run, diagnose, refine, run again, compare, until nothing more is found.

    In virtual time, or through a running daemon: its axes then move, other models are applied while
    they hold, and before each motion somebody is asked. A round counts only where no error becomes
    larger: of the model, and of the closed loop on the machine's own motion and on one that was
    not used.
    """
    from motorctl.cli.measure_tables import print_measures
    from motorctl.cli.progress import showing_stages
    from motorctl.close_loop.json_document import closed_loop_document, effects_added
    from motorctl.close_loop.report import write_reports
    from motorctl.close_loop.rounds import close_loop
    from motorctl.close_loop.run_folder import refuse_recordings_of_a_machine
    from motorctl.close_loop.tables import (
        error_row,
        share_words,
        telling_words,
        tracking_table,
        velocity_words,
    )
    from motorctl.errors import UsageError
    from motorctl.identify.compare.measures import table_headings

    if duration is not None and not 2.0 <= duration < float("inf"):
        raise UsageError(f"--duration {duration:g}: should be a number of seconds from 2 on")
    if not (resume or force):
        refuse_recordings_of_a_machine(out)
    rig, consents = None, None
    with ExitStack() as machine:
        progress = machine.enter_context(showing_stages(bar=socket is None))
        if socket:
            rig, consents = machine.enter_context(_rig_of(socket, out, yes=yes, resume=resume))
        loop = close_loop(
            config,
            out,
            rounds=rounds,
            motion=None if motion is None else motion.value,
            duration_s=duration,
            rig=rig,
            resume=resume,
            progress=progress,
        )
        progress("writing reports", 0.0)
        page = write_reports(loop)
    moved = None
    if rig is not None and consents is not None:
        asked = {"minutes": consents.minutes, "questions": consents.questions}
        moved = {"motions": rig.motions, **asked, "disturbed_share": loop.disturbed}
    if as_json:
        say(json.dumps(closed_loop_document(loop) | {"moved": moved, "report": str(page)}))
        return
    for part in loop.rounds:
        say(f"round {part.number}")
        if part.telling is not None:
            for words in telling_words(part.telling):
                say(f"  {words}")
        for name, axis in part.diagnosis.axes.items():
            say(f"  axis {name}: {axis.sentence}")
            accepted = part.accepted
            if accepted is not None and name in accepted.refinement.axes:
                for words in accepted.refinement.axes[name].done[:1]:
                    say(f"    {words}")
            share = part.attempts.shares.get(name)
            if share is not None and share.tracking:
                say(f"    {share_words(part.added(name), share)}")
            for words in part.attempts.dropped.get(name, ()):
                say(f"    left out {words}")
        for name, why in part.diagnosis.refused.items():
            say(f"  axis {name} was not diagnosed: {why}")
    say(f"then: {loop.ended}")
    if loop.velocity is not None:
        say(velocity_words(loop.velocity))
    say()
    for name, judgement in loop.overall.items():
        print_measures(name, tracking_table(judgement), table_headings(judgement.units.position))
        say(f"  {error_row(judgement)}")
        say(f"  effects added: {', '.join(effects_added(loop, name)) or 'none'}")
    if moved is not None:
        say(_moved_words(moved))
    say(f"{loop.refined}\n{page}")


def _moved_words(moved: dict[str, Any]) -> str:
    minutes = ", ".join(f"{name} {value:.1f}" for name, value in moved["minutes"].items())
    return (
        f"{moved['motions']} motions on the machine, minutes of each axis: {minutes or 'none'}; "
        f"somebody was asked {moved['questions']} times; as samples were missing, up to "
        f"{moved['disturbed_share']:.0%} of a motion's rows count for nothing"
    )


@contextmanager
def _rig_of(
    socket: Path, out: Path, *, yes: bool, resume: bool
) -> Iterator[tuple[MachineRig, Consents]]:
    """Yield the machine behind a daemon's socket, and who agrees to its motions.

    What ends it early stops its axes before.

    In the end the models run that were kept: what was tried last may not be among them.
    """
    from motorctl.cli.consent import Consents
    from motorctl.close_loop.machine_rig import MachineRig
    from motorctl.daemon.client import Client
    from motorctl.daemon.running_machine import ended_in_order, machine_of_daemon

    with ended_in_order(), Client(socket) as client:
        consents = Consents(yes=yes, kept=out / "moved_minutes.json", resume=resume)
        rig = MachineRig(client, machine_of_daemon(client), consents.ask)
        try:
            yield rig, consents
        except BaseException:
            left = rig.stop()
            if rig.begun:
                told = "the axes were told to stop"
                if left:
                    told = f"axis {', '.join(left)} could not be told to stop: look at the machine"
                say(
                    f"broken off; {told}, and the daemon's logs hold what was "
                    f"recorded. {out} keeps {rig.motions} of {rig.begun} motions that were begun, "
                    "run whole: the same command with --resume goes on after them",
                    err=True,
                )
                _leave(rig)
            raise
        _leave(rig)


def _leave(rig: MachineRig) -> None:
    """Have the models run that were kept, and say so."""
    from motorctl.errors import MotorctlError

    try:
        changed = rig.leave()
    except MotorctlError as error:
        say(f"the models that were tried last run on: {error}", err=True)
    else:
        if changed:
            told = "the models that were kept run again, on trial where they are not proven"
            say(f"axis {', '.join(changed)}: {told}", err=True)
