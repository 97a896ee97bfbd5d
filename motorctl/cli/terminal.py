"""The console of every table and picture: what others wrote is shown, and never obeyed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from motorctl.printable import printable


class Terminal(Console):
    """A console that writes out what a terminal would obey, in whatever it is given.

    Its own colours and movements stay: rich keeps them apart from the text.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Return the segments of an object, each with harmless text."""
        for segment in super().render(renderable, options):
            if segment.is_control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)


def open_table(title: str, columns: Sequence[str], *, numbers: bool = False) -> Table:
    """Return an empty table without frames, which take a fifth of 80 columns.

    Parameters
    ----------
    title
        Above it, at the left.
    columns
        Headings; the first column is a name, which is never broken.
    numbers
        The other columns are numbers, at the right.
    """
    table = Table(
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        title=title,
        title_justify="left",
        title_style="bold",
    )
    for index, column in enumerate(columns):
        table.add_column(
            column,
            justify="right" if numbers and index else "left",
            no_wrap=index == 0,
            overflow="fold",
        )
    return table


def print_axis(
    axis: str, headings: Sequence[str], rows: Iterable[Sequence[str]], words: Iterable[str]
) -> None:
    """Print figures of an axis as a table, and what they rest on below it.

    Parameters
    ----------
    axis
        What it is called.
    headings
        Of the columns behind the first, which says what the figure is.
    rows
        The cells of each row.
    words
        A sentence a line.
    """
    table = Table(title=f"Axis {axis}", title_justify="left")
    table.add_column("")
    for heading in headings:
        table.add_column(heading, justify="right")
    for cells in rows:
        table.add_row(*cells)
    console = Terminal()
    console.print(table)
    for each in words:
        console.print(f"  {each}", markup=False, highlight=False)
