"""Grids of nonlinear parameters, on which diagnosis looks for the best form of an effect."""

from __future__ import annotations

import math


def log_grid(low: float, high: float, per_decade: int) -> list[float]:
    """Return values from low to high, both included, at least per_decade of them a decade.

    Empty where low and high are not positive, finite and in this order.
    """
    if not 0.0 < low <= high < math.inf:
        return []
    steps = math.ceil(per_decade * math.log10(high / low))
    if steps == 0:
        return [low]
    inner = [low * (high / low) ** (i / steps) for i in range(1, steps)]
    return [low, *inner, high]


def log_step(value: float, per_decade: int) -> float:
    """Return the distance from a value to its next neighbour in such a grid."""
    return float(value * (10.0 ** (1.0 / per_decade) - 1.0))


def even_grid(low: float, high: float, step: float) -> list[float]:
    """Return low, low + step, ... up to high; empty where there is nothing between them."""
    if not (0.0 < step < math.inf and -math.inf < low <= high < math.inf):
        return []
    return [low + i * step for i in range(int((high - low) / step) + 1)]
