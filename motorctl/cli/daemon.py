"""The daemon in the foreground, and with it the commands that talk to one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motorctl.cli import axis_commands, jog, model_commands, status
from motorctl.cli.allowed_code_option import AllowedCodeOption
from motorctl.cli.config_argument import ConfigArgument
from motorctl.cli.socket_option import SocketOption


def run(
    config: ConfigArgument,
    log_dir: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Where logs go; usual: the configuration's.", show_default=False
        ),
    ] = None,
    socket: SocketOption = None,
    group: Annotated[
        str | None,
        typer.Option(
            metavar="GROUP",
            help="Whose members may connect, besides root; usual: the daemon's own.",
            show_default=False,
        ),
    ] = None,
    operators: Annotated[
        str | None,
        typer.Option(
            metavar="GROUP",
            help="Whose members may command, of those who may connect; the others may ask for the "
            "status, and for an emergency stop. Usual: all may command.",
            show_default=False,
        ),
    ] = None,
    only_allowed_code: AllowedCodeOption = None,
) -> None:
    """Run the daemon in the foreground.

    SIGTERM or Ctrl-C ramps every axis down, closes the log and ends it; a second one is an
    emergency stop.

    Example: motorctl run published_gantry --log-dir logs
    """
    from motorctl.garbage import collecting_seldom

    with collecting_seldom():
        from motorctl.config import AllowedCode, load
        from motorctl.daemon.journal import journal
        from motorctl.daemon.supervisor import DaemonOptions, run_daemon

    allowed = None if only_allowed_code is None else AllowedCode.read(only_allowed_code)
    may_run = None if allowed is None else allowed.allows
    options = DaemonOptions(socket, group, operators, log_dir, may_run)
    with journal():
        with collecting_seldom():
            machine = load(config, allowed_code=allowed)
        run_daemon(machine, options)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(run)
    status.register(app)
    axis_commands.register(app)
    jog.register(app)
    model_commands.register(app)
