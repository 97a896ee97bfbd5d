"""Progress on stderr, where that is a terminal: a share of work, its stages, or that it goes on."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from motorctl.cli.say import say
from motorctl.cli.terminal import Terminal


@contextmanager
def showing_progress(what: str) -> Iterator[Callable[[float], None]]:
    """Show a bar for work that tells the share that is done, 0 to 1."""
    with _line(BarColumn(), TaskProgressColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def showing_stages(
    *, lines: bool = False, bar: bool = True
) -> Iterator[Callable[[str, float], None]]:
    """Show what is being done, and the share of it that is: (what, 0 to 1).

    With `lines` a line for each stage where there is no terminal, so that minutes are not silent;
    without `bar` in a terminal, too, so that somebody can be asked something meanwhile.
    """
    if not bar or (lines and not sys.stderr.isatty()):
        yield _telling_stages(time.monotonic())
        return
    with _line(BarColumn(), TaskProgressColumn(), TimeElapsedColumn()) as shown:
        task = shown.add_task("", total=1.0)
        yield lambda what, share: shown.update(task, description=what, completed=share)


@contextmanager
def showing_work(what: str) -> Iterator[Callable[[str], None]]:
    """Show that work goes on, and what it is, where nobody knows how long it takes."""
    with _line(TimeElapsedColumn(), first=SpinnerColumn()) as spinner:
        task = spinner.add_task(what)
        yield lambda now: spinner.update(task, description=now)


def _line(*columns: ProgressColumn, first: ProgressColumn | None = None) -> Progress:
    console = Terminal(stderr=True)
    begin = [first] if first else []
    return Progress(
        *begin,
        TextColumn("{task.description}"),
        *columns,
        console=console,
        disable=not console.is_terminal,
        transient=True,
    )


def _telling_stages(began: float) -> Callable[[str, float], None]:
    last = ""

    def tell(what: str, share: float) -> None:
        nonlocal last
        if what != last:
            last = what
            say(f"{time.monotonic() - began:5.0f} s  {what}", err=True)

    return tell
