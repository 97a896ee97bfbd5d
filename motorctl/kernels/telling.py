"""What a user is told while kernels are compiled."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event


class _Teller(event.Listener):
    """Writes one line when the first function is compiled."""

    def __init__(self, line: str) -> None:
        self._line = line

    def on_start(self, event: Any) -> None:
        """Write the line, once."""
        if self._line:
            print(self._line, file=sys.stderr, flush=True)
        self._line = ""

    def on_end(self, event: Any) -> None:
        """Stay silent."""


@contextmanager
def compiling_told(line: str) -> Iterator[None]:
    """Write a line to stderr if anything is compiled inside, before it is.

    What is found in the cache is not worth a line.

    Parameters
    ----------
    line
        What is written, once.

    Yields
    ------
    None
        Compilation is watched until the context ends.
    """
    with event.install_listener("numba:compile", _Teller(line)):
        yield
