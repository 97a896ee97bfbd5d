"""The command line: one file a group of commands, no logic of its own."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from motorctl.cli.beginning import say_first
from motorctl.cli.say import say
from motorctl.errors import MotorctlError

if TYPE_CHECKING:
    import typer

GROUPS = (
    "demo",
    "init",
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
    "scope",
    "metrics",
    "stream",
    "close_loop",
    "experiment",
    "tune",
    "learn",
    "response",
    "fleet",
    "latency",
)
"""Modules of this package in the order in which `--help` lists their commands."""


def make_app() -> typer.Typer:
    """Assemble the commands of every group."""
    from motorctl.cli.app import assemble  # long to load: something is said before

    return assemble(GROUPS)


def main() -> None:
    """Run the command line; a foreseen error is one message and an exit status."""
    say_first(sys.argv[1:])
    try:
        make_app()()
    except MotorctlError as error:
        say(f"motorctl: {error}", err=True)
        sys.exit(error.exit_status)
    except BrokenPipeError:
        # The reader of our output went away; nothing is wrong, and nobody is left to tell.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
