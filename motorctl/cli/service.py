"""`motorctl service`: the daemon as a service of systemd."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.say import say
from motorctl.cli.whole_help import WholeHelp

if TYPE_CHECKING:
    from motorctl.service import Outcome

NameArgument = Annotated[
    str,
    typer.Argument(
        metavar="[NAME]", help="Of the gantry: /etc/motorctl/NAME.yaml, motorctl@NAME.service."
    ),
]
RootOption = Annotated[
    Path, typer.Option("--root", metavar="DIR", help="Another system's root folder.")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Only tell what would be done.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
USUAL_NAME = "machine"


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=WholeHelp, no_args_is_help=True)
    install = "Example: motorctl service install left --config left.yaml"
    group.command("install", epilog=install)(_install)
    group.command("remove", epilog="Example: motorctl service remove left")(_remove)
    app.add_typer(group, name="service", help="Install or remove the daemon as a service.")


def _install(
    name: NameArgument = USUAL_NAME,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Checked, then copied to /etc/motorctl; usual: what is there.",
            show_default=False,
        ),
    ] = None,
    user: Annotated[
        str | None,
        typer.Option(help="Whom the daemon runs as; usual: motorctl.", show_default=False),
    ] = None,
    group: Annotated[
        str | None,
        typer.Option(
            help="Whose members may connect and, without --operators, command; usual: motorctl.",
            show_default=False,
        ),
    ] = None,
    operators: Annotated[
        str | None,
        typer.Option(
            metavar="GROUP",
            help="Whose members may command, of those of --group; the others may ask for the "
            "status, and for an emergency stop. Usual: as installed, at first none; --group's own "
            "name: all its members again.",
            show_default=False,
        ),
    ] = None,
    configurators: Annotated[
        str | None,
        typer.Option(
            metavar="GROUP",
            help="Whose members may change this gantry's configuration, for its next start. Usual: "
            "as installed, at first none but root; root: none else again.",
            show_default=False,
        ),
    ] = None,
    root: RootOption = Path("/"),
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> None:
    """Check the configuration; write unit, user, group and device rules; tell what is next.

    It starts nothing. Several gantries live side by side, each under a name.
    """
    from motorctl.service import Request, install

    request = Request(name, config, user, group, operators, configurators, root, dry_run)
    _show(install(request), as_json)


def _remove(
    name: NameArgument = USUAL_NAME,
    root: RootOption = Path("/"),
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> None:
    """Stop a gantry's service and remove it; configuration and logs stay."""
    from motorctl.service import remove

    _show(remove(name, root, dry_run), as_json)


def _show(outcome: Outcome, as_json: bool) -> None:
    if as_json:
        say(json.dumps(outcome.document()))
    else:
        say("\n".join(outcome.lines()))
