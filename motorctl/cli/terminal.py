"""The console of every table and picture: what others wrote is shown, and never obeyed."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

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
