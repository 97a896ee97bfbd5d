"""The command line: one file a group of commands, no logic of its own."""

from __future__ import annotations

import importlib
import os
import sys

import typer

from motorctl import __version__
from motorctl.cli.installed import Commands
from motorctl.cli.say import say
from motorctl.errors import MotorctlError

GROUPS = (
    "demo",
    "check",
    "drivers",
    "effects",
    "daemon",
    "service",
    "simulate",
    "log",
    "fault",
    "fit",
    "diagnose",
    "refine",
    "compare",
    "close_loop",
    "tune",
    "response",
    "latency",
)
"""Modules of this package in the order in which `--help` lists their commands."""


def make_app() -> typer.Typer:
    """Assemble the commands of every group."""
    app = typer.Typer(
        name="motorctl",
        cls=Commands,
        help="Real-time motion control that closes the loop with measured data.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        add_completion=False,
        rich_markup_mode=None,
    )

    @app.callback(invoke_without_command=True)
    def options(
        context: typer.Context,
        version: bool = typer.Option(False, "--version", help="Print the version."),
    ) -> None:
        if version:
            say(__version__)
            raise typer.Exit
        if context.invoked_subcommand is None:
            raise typer.Exit(2)

    for group in GROUPS:
        importlib.import_module(f"motorctl.cli.{group}").register(app)
    return app


def main() -> None:
    """Run the command line; a foreseen error is one message and an exit status."""
    try:
        make_app()()
    except MotorctlError as error:
        say(f"motorctl: {error}", err=True)
        sys.exit(error.exit_status)
    except BrokenPipeError:
        # The reader of our output went away; nothing is wrong, and nobody is left to tell.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
