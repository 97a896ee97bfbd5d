"""An effect whose table ends too early: beyond a place it has no number for the law."""

from __future__ import annotations

import math

from numba import njit

from motorctl.model import Effect, Parameter

ENDS_M = 0.2


class BrokenMap(Effect):
    """NaN beyond a place, as of a table that was read beyond its end."""

    name = "broken_map"
    kind = "state"
    title = "Map that ends too early"
    formula = "c * nan beyond x_0"
    compensated = "feedforward at the desired position"
    identified = "never"
    visible_in = "motion beyond its end"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """c: anything times no number is none."""
        return (Parameter("", "c", "V", -1.0, 1.0, 0.0, 1.0),)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return 0 up to the place, and no number beyond it."""
    return math.nan if x > ENDS_M else 0.0
