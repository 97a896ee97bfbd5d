"""Commands to the axes of a running daemon."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption
from motorctl.printable import one_line

if TYPE_CHECKING:
    from motorctl.daemon.client import Client

AxisArgument = Annotated[str, typer.Argument(metavar="AXIS", help="Name of the axis.")]
WaitOption = Annotated[bool, typer.Option("--wait", help="Return when the motion is at its end.")]

REACHED_TIMEOUT_S = 5.0
STOP_TIMEOUT_S = 60.0


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
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        answer = _ask(client, "start", axis=axis, **({"hold": True} if hold else {}))
        if missing := answer.get("waits_for"):
            others = " and ".join(missing)
            _say(axis, f"enabled, holds; program {answer['program']} waits for {others}")
        elif "program" in answer:
            _tell_program(axis, answer)
            _wait_for_end(client, axis, wait)
        else:
            client.wait_for(axis, _in("idle", "running"), REACHED_TIMEOUT_S)
            _say(axis, "enabled, holds")


def stop(axis: AxisArgument, socket: SocketOption = None) -> None:
    """Ramp an axis down and disable it.

    Example: motorctl stop x
    """
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        _ask(client, "stop", axis=axis)
        client.wait_for(axis, _in("off"), STOP_TIMEOUT_S)
    _say(axis, "off")


def home(axis: AxisArgument, socket: SocketOption = None) -> None:
    """Find an axis' zero.

    An axis that is off is enabled first. Returns when the zero is found.

    Example: motorctl home x
    """
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        _ask(client, "home", axis=axis)
        status = client.wait_for(axis, _in("idle", "off", "stopping"), None)
    if status["homed"] and status["state"] == "idle":
        _say(axis, f"homed, at {_millimetres(status['position_m'])}")
    else:
        from motorctl.errors import RunError

        raise RunError(f"axis {axis}: homing was stopped")


def move(
    axis: AxisArgument,
    position_m: Annotated[float, typer.Argument(metavar="POSITION_M", help="Where to, in metres.")],
    velocity: Annotated[
        float | None, typer.Option(help="m/s; usual: the axis' limit.", show_default=False)
    ] = None,
    acceleration: Annotated[
        float | None, typer.Option(help="m/s^2; usual: that of the stop ramp.", show_default=False)
    ] = None,
    socket: SocketOption = None,
    wait: WaitOption = False,
) -> None:
    """Move an axis that holds to a position.

    The whole move is checked against every limit before anything moves.

    Example: motorctl move x 0.25 --velocity 0.5 --wait
    """
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        answer = _ask(
            client,
            "move",
            axis=axis,
            position_m=position_m,
            velocity_m_s=velocity,
            acceleration_m_s2=acceleration,
        )
        _say(axis, f"to {_millimetres(position_m)} in {answer['duration_s']:.2f} s")
        _wait_for_end(client, axis, wait)


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
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        request: dict[str, Any] = {"name": name_or_file}
        path = Path(name_or_file)
        if path.suffix.lower() in {".yaml", ".yml", ".csv"} or len(path.parts) > 1:
            from motorctl.daemon.program_transfer import packed

            request = packed(path, list(client.ask("status")["axes"]))
        answer = _ask(client, "program", axis=axis, **request)
        _tell_program(axis, answer)
        _wait_for_end(client, axis, wait)


def reset(axis: AxisArgument, socket: SocketOption = None) -> None:
    """Clear an axis' fault once its cause is gone.

    A drive that keeps its own fault is asked to forget it. A driver that lost its bus or port, or
    whose device restarted, is closed and opened anew; its axes have to be homed again.

    Example: motorctl reset x
    """
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        answer = _ask(client, "reset", axis=axis)
    driver = answer.get("opened")
    home = "" if answer["homed"] else f"; `motorctl home {axis}` comes next"
    cleared = "off; the fault of its drive was cleared" if answer.get("cleared") else "off"
    _say(axis, f"off; driver {driver} was opened anew{home}" if driver else cleared)


def estop(socket: SocketOption = None) -> None:
    """Zero and disable every axis at once.

    Each is in the state fault then, until it is reset.

    Example: motorctl estop
    """
    from motorctl.daemon.client import Client

    with Client(socket) as client:
        answer = client.ask("estop")
    say(one_line(f"emergency stop: {', '.join(answer['axes'])}"))


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


def _ask(client: Client, do: str, **arguments: Any) -> dict[str, Any]:
    """Send a command; a daemon that gets ready, and an axis that still moves, are waited for."""
    return client.ask_when_ready(do, _tell_wait, **arguments)


def _tell_wait(why: str) -> None:
    if sys.stderr.isatty():
        say(f"motorctl: waiting: {why}", err=True)


def _in(*states: str) -> Any:
    return lambda status: status["state"] in states


def _wait_for_end(client: Client, axis: str, wait: bool) -> None:
    if wait:
        client.wait_for(axis, _in("idle", "off"), None)


def _tell_program(axis: str, answer: dict[str, Any]) -> None:
    axes = ", ".join(answer["axes"])
    approach = f", {answer['approach_s']:.2f} s of approach" if answer["approach_s"] > 0 else ""
    _say(axis, f"program {answer['program']} on {axes}: {answer['duration_s']:.2f} s{approach}")


def _say(axis: str, text: str) -> None:
    say(one_line(f"axis {axis}: {text}"))


def _millimetres(position_m: float) -> str:
    return f"{position_m * 1e3:.4f} mm"
