"""No looking for garbage while numba compiles: what it makes is kept until it is done."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

from numba.core import event

from motorctl.garbage import collecting_seldom


class _Seldom(event.Listener):
    """Wraps each compilation, of which one may begin within another; numba locks out others."""

    def __init__(self) -> None:
        self._begun: list[ExitStack] = []

    def on_start(self, event: Any) -> None:
        """Begin."""
        begun = ExitStack()
        begun.enter_context(collecting_seldom())
        self._begun.append(begun)

    def on_end(self, event: Any) -> None:
        """Go back to what was before."""
        if self._begun:  # else the first began before this was registered
            self._begun.pop().close()


def collect_seldom_while_compiling() -> None:
    """Have garbage looked for seldom in every compilation from here on."""
    register: Any = event.register
    register("numba:compile", _Seldom())
