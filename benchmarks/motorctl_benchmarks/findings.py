"""What a subject of the bench found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from motorctl.latency.figure import Figure


@dataclass(frozen=True)
class TextTable:
    """A table in words, as Markdown has them: what is printed can stand in a page as it is."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def lines(self) -> list[str]:
        """Return its lines, the title before them."""
        widths = [max(map(len, column)) for column in zip(self.columns, *self.rows, strict=True)]
        rule = tuple("-" * width for width in widths)
        return [
            f"**{self.title}**",
            "",
            *(
                f"| {' | '.join(c.ljust(w) for c, w in zip(row, widths, strict=True))} |"
                for row in (self.columns, rule, *self.rows)
            ),
        ]


@dataclass(frozen=True)
class Findings:
    """Figures, and what to know of them."""

    figures: tuple[Figure, ...]
    notes: tuple[str, ...]
    mistakes: tuple[Mapping[str, str], ...] = ()
    """Cases that came out wrong: case, truth and answer."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """What else is told, as plain data by name."""
    tables: tuple[TextTable, ...] = ()
    head: str = ""
    """A line of Markdown that stands above the tables in a page; empty: the tables are for the
    terminal alone."""
    failed: bool = False
    """The exit status shall tell that something is not as it has to be."""
