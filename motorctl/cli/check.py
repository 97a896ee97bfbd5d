"""`motorctl check`: validate a configuration and show the machine that it describes."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from motorctl.cli.choices import ControllerChoice


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("check", epilog="Example: motorctl check published_gantry --controller C1")(_check)


def _check(
    config: Annotated[
        str | None, typer.Argument(help="A YAML file, or a shipped configuration's name.")
    ] = None,
    controller: Annotated[
        ControllerChoice | None, typer.Option(help="In place of what the axes say.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of configurations, for editors.")
    ] = False,
) -> None:
    """Validate a configuration; print the machine, the bus budgets, the closed loop's margins.

    Every problem is told at once, with file, line and key; the exit status is then 2.
    """
    from rich.console import Console

    from motorctl.cli.check_tables import print_summary
    from motorctl.config import config_schema, load, summarise
    from motorctl.errors import ConfigError, UsageError

    if schema:
        typer.echo(json.dumps(config_schema(), indent=2, ensure_ascii=False))
        return
    if config is None:
        raise UsageError("check needs a configuration, for example: motorctl check small_stage")
    try:
        machine = load(config, None if controller is None else controller.value)
    except ConfigError as error:
        if as_json:
            problems = [vars(problem) for problem in error.problems]
            typer.echo(json.dumps({"valid": False, "problems": problems}, indent=2))
        raise
    summary = summarise(machine)
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
    else:
        print_summary(Console(), summary)
