"""How far a measurement is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float], None]
"""Told the share that is done, 0 to 1."""


def part_of(progress: Progress, begin: float, end: float) -> Progress:
    """Return the progress of one part of a longer work, from share `begin` to `end` of it."""
    return lambda share: progress(begin + (end - begin) * share)
