"""Progress of work in stages on stderr, where that is a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn


@contextmanager
def showing_stages(*, lines: bool = False) -> Iterator[Callable[[str, float], None]]:
    """Show what is being done, and the share of it that is: (what, 0 to 1).

    With `lines` a line for each stage where there is no terminal, so that minutes are not silent.
    """
    console = Console(stderr=True)
    if lines and not console.is_terminal:
        yield _telling_stages(time.monotonic())
        return
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=True,
    )
    with bar:
        task = bar.add_task("", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


def _telling_stages(began: float) -> Callable[[str, float], None]:
    last = ""

    def tell(what: str, share: float) -> None:
        nonlocal last
        if what != last:
            last = what
            print(f"{time.monotonic() - began:5.0f} s  {what}", file=sys.stderr, flush=True)

    return tell
