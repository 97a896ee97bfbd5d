"""Lists of commands whose help is wrapped and never cut."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from typer.core import TyperGroup

SECTIONS: Mapping[str, tuple[str, ...]] = {
    "Begin": ("demo", "init", "check", "drivers", "effects", "simulate", "latency"),
    "Run a machine": (
        *("run", "status", "start", "stop", "home", "move", "jog", "program", "reset", "estop"),
        *("apply", "revert", "models", "service"),
    ),
    "Look at what was recorded": ("log", "fault", "scope", "compare"),
    "Find what the model lacks": ("fit", "diagnose", "refine", "close-loop", "experiment"),
    "Hand it to other programs": ("metrics", "stream"),
    "Tune": ("tune", "response", "learn"),
    "Many machines": ("fleet",),
}
"""Where `motorctl --help` lists a command; what no section names comes last, under "More"."""
LONGEST_HELP = 1000
"""Of a command in a list [characters]: longer than any first sentence, so none is cut."""


class WholeHelp(TyperGroup):
    """A group of commands that lists each with its whole first sentence."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in their order."""
        with formatter.section("Commands"):
            formatter.write_dl(self._rows(ctx, self.list_commands(ctx)))

    def _rows(self, ctx: Any, names: Iterable[str]) -> list[tuple[str, str]]:
        commands = ((name, self.get_command(ctx, name)) for name in names)
        return [
            (name, command.get_short_help_str(LONGEST_HELP))
            for name, command in commands
            if command is not None and not command.hidden
        ]


class SectionedHelp(WholeHelp):
    """A group that lists its commands by what they are for."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands section by section."""
        left = self.list_commands(ctx)
        width = max(len(name) for name in left)
        for title, names in SECTIONS.items():
            self._section(ctx, formatter, title, [n for n in names if n in left], width)
        named = {name for names in SECTIONS.values() for name in names}
        self._section(ctx, formatter, "More", [n for n in left if n not in named], width)

    def _section(
        self,
        ctx: Any,
        formatter: Any,
        title: str,
        names: list[str],
        width: int,
    ) -> None:
        if names:
            with formatter.section(title):
                rows = self._rows(ctx, names)
                formatter.write_dl([(name.ljust(width), text) for name, text in rows])
