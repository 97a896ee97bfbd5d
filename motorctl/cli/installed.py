"""Commands of other packages, found through entry points and imported when they are called."""

from __future__ import annotations

import importlib.util
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand

from motorctl.cli.whole_help import SectionedHelp
from motorctl.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable

GROUP = "motorctl.commands"
TOLD = {
    "gantry-device": "Serve the simulated gantry over a bus, with faults to order.",
    "bench": "Measure how fast motorctl is, how often its diagnoses are right, what guards detect.",
}
"""What `--help` says of motorctl's own; of others it says which package they are from."""
FOLDERS = {"motorctl_devices": "./devices", "motorctl_benchmarks": "./devices ./benchmarks"}
"""What `pip install` takes in a checkout of motorctl for a package that has a command."""


class Commands(SectionedHelp):
    """The commands of motorctl, and those that other packages register."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        for command in installed_commands(entry_points(group=GROUP)):
            self.commands.setdefault(command.name or "", command)


class InstalledCommand(TyperCommand):
    """A command whose package is imported once it is called."""

    def __init__(self, point: EntryPoint) -> None:
        package = point.dist.name if point.dist else point.module
        super().__init__(
            point.name,
            callback=lambda: None,
            help=TOLD.get(point.name, f"A command of the package {package}."),
            rich_markup_mode=None,
        )
        self._point = point

    def make_context(
        self, info_name: Any, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """Import the package, and let its own command take the arguments. Raises UsageError."""
        command = _loaded(self._point)
        return command.make_context(info_name, args, parent, **extra)


def installed_commands(points: Iterable[EntryPoint]) -> list[InstalledCommand]:
    """Return a command for each entry point, in order of their names, without importing any.

    Parameters
    ----------
    points
        Entry points of the group ``motorctl.commands``. Each names a function as typer takes it,
        or an application of typer's that has commands of its own.
    """
    return [InstalledCommand(point) for point in sorted(points, key=lambda p: p.name)]


def _loaded(point: EntryPoint) -> Any:
    """Return the command of an entry point. Raises UsageError where it cannot be had."""
    package = point.module.partition(".")[0]
    if importlib.util.find_spec(package) is None:
        folders = FOLDERS.get(package)
        hint = f": pip install {folders}, in a checkout of motorctl" if folders else ""
        raise UsageError(f"{point.name} is a command of {package}, which is not installed{hint}")
    try:
        given = point.load()
        if isinstance(given, typer.Typer):
            return typer.main.get_command(given)
        app = typer.Typer(
            add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
        )
        app.command(point.name)(given)
        return typer.main.get_command(app)
    except Exception as error:  # a third party's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        raise UsageError(f"{point.name} ({point.value}) failed to load: {cause}") from error
