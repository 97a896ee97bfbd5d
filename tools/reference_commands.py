"""The reference page of commands, from what `motorctl COMMAND --help` is made of."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer

from motorctl.cli import make_app
from motorctl.cli.whole_help import SECTIONS


def commands_page(made_by: str) -> str:
    """Return every command with its arguments and options.

    Parameters
    ----------
    made_by
        The line that says what made the page.
    """
    program: Any = typer.main.get_command(make_app())
    # Arguments are not there, and nothing is run: only the help is asked for.
    context = program.make_context("motorctl", [], resilient_parsing=True)
    names = program.list_commands(context)
    sections = {title: [n for n in told if n in names] for title, told in SECTIONS.items()}
    named = {name for told in sections.values() for name in told}
    sections["More"] = [name for name in names if name not in named]
    lines = [
        "# Every command",
        "",
        made_by,
        "",
        "What `motorctl --help` and `motorctl COMMAND --help` tell. A bad input ends a command "
        "with one message and exit status 2; `--json`, where a command has it, prints one document "
        "for programs.",
    ]
    for title, told in sections.items():
        lines += ["", f"## {title}"]
        for name in told:
            lines += _command(program.get_command(context, name), name, context)
    return "\n".join(lines) + "\n"


def _command(command: Any, name: str, parent: Any) -> Iterator[str]:
    """Yield a command's own part of the page, and those of the commands below it."""
    context = command.make_context(name, [], parent=parent, resilient_parsing=True)
    command = context.command  # of one from another package: that which it has loaded
    yield from ("", f"### motorctl {context.command_path.removeprefix('motorctl ')}", "")
    yield f"`{' '.join(_usage(command, context))}`"
    for paragraph in (*(command.help or "").split("\n\n"), command.epilog or ""):
        yield from _paragraph(paragraph)
    records = [param.get_help_record(context) for param in command.get_params(context)]
    told = [r for r in records if r is not None and r[0] != "--help"]
    if told:
        yield from ("", "| | |", "|---|---|")
        yield from (f"| `{_cell(what)}` | {_cell(words)} |" for what, words in told)
    for below in command.list_commands(context) if hasattr(command, "list_commands") else ():
        yield from _command(command.get_command(context, below), below, context)


def _usage(command: Any, context: Any) -> list[str]:
    return [context.command_path, *command.collect_usage_pieces(context)]


def _paragraph(text: str) -> Iterator[str]:
    lines = [line.strip() for line in text.replace("\b", "").strip().splitlines()]
    if lines and lines[0].startswith("Example:"):
        code = [line for line in (lines[0].removeprefix("Example:").strip(), *lines[1:]) if line]
        yield from ("", "```sh", *code, "```")
    elif lines:
        yield from ("", " ".join(lines).replace("<", "&lt;").replace("*", "\\*"))


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
