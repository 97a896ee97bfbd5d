"""How many of a test's parameters the slow run takes; the long run takes all."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def few_of(values: Iterable[Any], few: int) -> list[Any]:
    """Return a test's parameters: a few, spread evenly over them, as they are; the others long.

    Parameters
    ----------
    values
        What the test is to be tried on; a tuple is several parameters.
    few
        How many the slow run takes.
    """
    every = list(values)
    quick = {k * len(every) // few for k in range(few)}
    return [
        value
        if k in quick
        else pytest.param(*value if isinstance(value, tuple) else (value,), marks=pytest.mark.long)
        for k, value in enumerate(every)
    ]
