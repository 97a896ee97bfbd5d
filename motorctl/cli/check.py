"""`motorctl check`: validate a configuration and show the machine that it describes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from motorctl.cli.allowed_code_option import AllowedCodeOption
from motorctl.cli.choices import ControllerChoice
from motorctl.cli.completion import configurations
from motorctl.cli.say import say


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("check", epilog="Example: motorctl check published_gantry --controller C1")(_check)


def _check(
    config: Annotated[
        str | None,
        typer.Argument(
            help="A YAML file, or a shipped configuration's name.", autocompletion=configurations
        ),
    ] = None,
    controller: Annotated[
        ControllerChoice | None, typer.Option(help="In place of what the axes say.")
    ] = None,
    code: Annotated[
        bool,
        typer.Option(
            "--code", help="Only tell which code the file would run; import and check nothing."
        ),
    ] = False,
    only_allowed_code: AllowedCodeOption = None,
    everything: Annotated[
        bool, typer.Option("--all", help="All that is known of the machine, not one screen of it.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Draw each axis' loop there: bode_AXIS.png."),
    ] = None,
    compiled: Annotated[
        bool,
        typer.Option(
            "--compile",
            help="Compile the loop into this user's cache as well, so that its first start does "
            "not wait for that.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of configurations, for editors.")
    ] = False,
) -> None:
    """Validate a configuration; print the machine, the bus budgets, the closed loop's margins.

    Every problem is told at once, with file, line and key; the exit status is then 2.
    """
    from motorctl.garbage import collecting_seldom

    with collecting_seldom():
        from motorctl.cli.check_screen import print_screen
        from motorctl.cli.check_tables import print_code, print_summary
        from motorctl.cli.terminal import Terminal
        from motorctl.config import AllowedCode, config_schema, load, summarise
        from motorctl.errors import ConfigError, UsageError

    if schema:
        say(json.dumps(config_schema(), indent=2, ensure_ascii=False))
        return
    if config is None:
        raise UsageError("check needs a configuration, for example: motorctl check small_stage")
    if code:
        told = _code(config, only_allowed_code)
        if as_json:
            say(json.dumps(told, indent=2))
        else:
            print_code(Terminal(), told)
        return
    allowed = None if only_allowed_code is None else AllowedCode.read(only_allowed_code)
    try:
        machine = load(
            config, None if controller is None else controller.value, allowed_code=allowed
        )
    except ConfigError as error:
        if as_json:
            problems = [vars(problem) for problem in error.problems]
            say(json.dumps({"valid": False, "problems": problems}, indent=2))
        raise
    summary = summarise(machine) | _code(config, only_allowed_code)
    if as_json:
        say(json.dumps(summary, indent=2))
    else:
        (print_summary if everything else print_screen)(Terminal(), summary)
    if compiled:
        from motorctl.loop.compiled_beside import compile_machine

        took_s = compile_machine(machine)
        say(f"compiled in {took_s:.1f} s: `motorctl run {config}` finds it in the cache", err=True)
    if out is not None:
        from motorctl.config.loop_picture import draw_loops

        for path in draw_loops(machine, out):
            say(path, err=as_json)


def _code(config: str, only_allowed: Path | None) -> dict[str, Any]:
    """Return what the file would run, and what the list allows: that of the service, if not named.

    A list that cannot be trusted allows nothing, and is told; one that was named is refused.
    """
    from motorctl.config import ALLOWED_CODE, AllowedCode, code_of_file
    from motorctl.errors import UsageError

    trouble = None
    try:
        allowed = AllowedCode.read(only_allowed or ALLOWED_CODE)
    except UsageError as error:
        if only_allowed is not None:
            raise
        allowed, trouble = AllowedCode(ALLOWED_CODE, frozenset()), str(error)
    return {
        "code": [each.plain(allowed.allows(each)) for each in code_of_file(config)],
        "allowed_code": {"file": str(allowed.source), "trouble": trouble},
    }
