"""Commands to the axes of a running daemon."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.completion import axes
from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.printable import one_line

if TYPE_CHECKING:
    from motorctl.api.orders import Motion, Reset
    from motorctl.axis_units import PositionUnit
    from motorctl.cli.lengths import Target

AxisArgument = Annotated[
    str, typer.Argument(metavar="AXIS", help="Name of the axis.", autocompletion=axes)
]
OptionalAxis = Annotated[
    str | None,
    typer.Argument(
        metavar="AXIS", help="Name of the axis.", show_default=False, autocompletion=axes
    ),
]
WaitOption = Annotated[bool, typer.Option("--wait", help="Return when the motion is at its end.")]


def start(
    axis: AxisArgument,
    socket: SocketOption = None,
    wait: WaitOption = False,
    hold: Annotated[
        bool, typer.Option("--hold", help="Hold, whatever program the axis has.")
    ] = False,
) -> None:
    """Enable an axis; it follows its program, or holds where it has none.

    It is enabled without a bump, where it stands. A program over several axes begins when the
    last of them is started.

    Example: motorctl start x
    """
    from motorctl import connect

    with connect(socket) as machine:
        started = machine.start(axis, hold=hold, on_wait=_tell_wait)
        if started.waits_for:
            others = " and ".join(started.waits_for)
            _say(axis, f"enabled, holds; program {started.program} waits for {others}")
        elif started.motion is not None:
            _tell_program(axis, started.motion)
            if wait:
                machine.wait(axis)
        else:
            _say(axis, "enabled, holds")


def stop(
    axis: OptionalAxis = None,
    every: Annotated[bool, typer.Option("--all", help="Every axis that is enabled.")] = False,
    socket: SocketOption = None,
) -> None:
    """Ramp an axis down and disable it.

    Example: motorctl stop x
    """
    from motorctl import connect
    from motorctl.errors import UsageError

    if every == (axis is not None):
        raise UsageError("stop needs the name of an axis, or --all")
    with connect(socket) as machine:
        if axis is not None:
            machine.stop(axis, on_wait=_tell_wait)
            _say(axis, "off")
            return
        stopped = machine.stop_all(on_wait=_tell_wait)
    for name in stopped:
        _say(name, "off")
    if not stopped:
        say("no axis was enabled")


def home(axis: AxisArgument, socket: SocketOption = None) -> None:
    """Find an axis' zero.

    An axis that is off is enabled first. Returns when the zero is found.

    Example: motorctl home x
    """
    from motorctl import connect
    from motorctl.axis_units import units_of

    with connect(socket) as machine:
        homed = machine.home(axis, on_wait=_tell_wait)
    assert homed.position_m is not None  # of an axis that holds it is known
    _say(axis, f"homed, at {units_of(homed.position_unit).told(homed.position_m)}")


def move(
    axis: AxisArgument,
    position: Annotated[
        str | None,
        typer.Argument(
            metavar="POSITION_M",
            help="Where to, in metres (rotary: rad), or with a unit (250mm, 90deg); +10mm goes so "
            "far from here.",
            show_default=False,
        ),
    ] = None,
    by: Annotated[
        str | None, typer.Option(help="Instead: how far from here, with either sign (-10mm).")
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(help="m/s (rad/s), or with a unit; usual: a quarter of the axis' limit."),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(help="m/s^2 (rad/s^2), or a unit; usual: that of the stop ramp."),
    ] = None,
    socket: SocketOption = None,
    wait: WaitOption = False,
) -> None:
    """Move an axis that holds to a position, or by a way.

    The whole move is checked against every limit before anything moves.

    Example: motorctl move x 0.25 --velocity 0.5 --wait
    """
    from motorctl import connect
    from motorctl.axis_units import units_of
    from motorctl.cli.lengths import acceleration_m_s2, target_of, velocity_m_s

    def given(own: PositionUnit | None) -> tuple[Target, float | None, float | None]:
        return (
            target_of(position, by, own),
            None if velocity is None else velocity_m_s(velocity, own),
            None if acceleration is None else acceleration_m_s2(acceleration, own),
        )

    given(None)  # what makes no sense of any axis needs no daemon to be refused
    with connect(socket) as machine:
        units = units_of(machine.axis_status(axis).position_unit)
        target, given_m_s, given_m_s2 = given(units.position)
        motion = machine.move(
            axis,
            target.position_m,
            by_m=target.by_m,
            velocity_m_s=given_m_s,
            acceleration_m_s2=given_m_s2,
            on_wait=_tell_wait,
        )
        assert motion.target_m is not None  # of a move
        _say(axis, f"to {units.told(motion.target_m)} in {motion.duration_s:.2f} s")
        if wait:
            machine.wait(axis)


def program(
    axis: AxisArgument,
    name_or_file: Annotated[
        str,
        typer.Argument(
            metavar="NAME-OR-FILE",
            help="A program of the configuration, or a YAML or CSV file (./file where unclear).",
        ),
    ],
    socket: SocketOption = None,
    wait: WaitOption = False,
) -> None:
    """Let an axis that holds follow a program.

    It is led to the program's start first. All axes of the program must hold; they begin it in
    the same tick.

    Example: motorctl program x ring --wait
    """
    from motorctl import connect

    with connect(socket) as machine:
        _tell_program(axis, machine.program(axis, name_or_file, on_wait=_tell_wait))
        if wait:
            machine.wait(axis)


def reset(
    axis: OptionalAxis = None,
    every: Annotated[bool, typer.Option("--all", help="Every axis in fault.")] = False,
    socket: SocketOption = None,
) -> None:
    """Clear an axis' fault once its cause is gone.

    A drive that keeps its own fault is asked to forget it. A driver that lost its bus or port, or
    whose device restarted, is closed and opened anew; its axes have to be homed again.

    Example: motorctl reset x
    """
    from motorctl import connect
    from motorctl.errors import UsageError

    if every == (axis is not None):
        raise UsageError("reset needs the name of an axis, or --all")
    with connect(socket) as machine:
        if axis is not None:
            _tell_reset(machine.reset(axis, on_wait=_tell_wait))
            return
        done = machine.reset_all(on_wait=_tell_wait)
    for each in done:
        _tell_reset(each)
    if not done:
        say("no axis was in fault")


def _tell_reset(done: Reset) -> None:
    home = "" if done.homed else f"; `motorctl home {done.axis}` comes next"
    cleared = "off; the fault of its drive was cleared" if done.cleared else "off"
    opened = f"off; driver {done.opened} was opened anew{home}"
    _say(done.axis, opened if done.opened else cleared)


def estop(socket: SocketOption = None) -> None:
    """Zero and disable every axis at once.

    Each is in the state fault then, until it is reset.

    Example: motorctl estop
    """
    from motorctl import connect

    with connect(socket) as machine:
        stopped = machine.estop()
    say(one_line(f"emergency stop: {', '.join(stopped)}"))


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(start)
    app.command()(stop)
    app.command()(home)
    # A negative position is no option.
    app.command(context_settings={"ignore_unknown_options": True})(move)
    app.command()(program)
    app.command()(reset)
    app.command()(estop)


def _tell_wait(why: str) -> None:
    if sys.stderr.isatty():
        say(f"motorctl: waiting: {why}", err=True)


def _tell_program(axis: str, motion: Motion) -> None:
    axes = ", ".join(motion.axes)
    approach = f", {motion.approach_s:.2f} s of approach" if motion.approach_s > 0 else ""
    _say(axis, f"program {motion.program} on {axes}: {motion.duration_s:.2f} s{approach}")
    for note in motion.notes:
        say(note, err=True)


def _say(axis: str, text: str) -> None:
    say(one_line(f"axis {axis}: {text}"))
