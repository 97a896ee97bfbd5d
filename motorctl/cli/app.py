"""The application: the commands of every group, put together."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

import typer

from motorctl.cli.installed import Commands
from motorctl.cli.say import say
from motorctl.version import VERSION


def assemble(groups: Sequence[str]) -> typer.Typer:
    """Return the application with the commands of these modules of the package, in their order."""
    app = typer.Typer(
        name="motorctl",
        cls=Commands,
        help="Real-time motion control that closes the loop with measured data.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )

    @app.callback(invoke_without_command=True)
    def options(
        context: typer.Context,
        version: bool = typer.Option(False, "--version", help="Print the version."),
    ) -> None:
        if version:
            say(VERSION)
            raise typer.Exit
        if context.invoked_subcommand is None:
            raise typer.Exit(2)

    for group in groups:
        importlib.import_module(f"motorctl.cli.{group}").register(app)
    return app
