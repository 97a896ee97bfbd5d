"""How often Python looks for garbage where nearly all that is made stays.

Modules, types and code that is being compiled are millions of objects that are not garbage. With
its usual thresholds Python goes through them again and again: a tenth of what compiling takes, a
fifth of what importing does.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = (20_000, 10, 20)
"""New objects until the youngest are looked through; how many of those looks until the middle ones
are; and of those until all are. Larger saves no more; these take 40 MB at most where a tick is
compiled. Measured."""


@contextmanager
def collecting_seldom() -> Iterator[None]:
    """Look for garbage seldom until the context ends; whether it is looked for at all stays.

    Yields
    ------
    None
        The thresholds that were there come back at the end.
    """
    before = gc.get_threshold()
    gc.set_threshold(*SELDOM)
    try:
        yield
    finally:
        gc.set_threshold(*before)
