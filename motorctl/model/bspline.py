"""Uniform cubic B-splines along the travel: a smooth function of position of any shape."""

from __future__ import annotations

from functools import cache
from typing import Annotated

from pydantic import AfterValidator, Field

from motorctl.kernels import inner_kernel
from motorctl.model.knowledge import Spans
from motorctl.model.parameter import Parameter

FEWEST, MOST = 4, 48
"""Basis functions over a range, at least and at most. Four are one cell, so any cubic polynomial,
and fewer none: arithmetic. A larger most makes the tick longer, a smaller one draws the travel too
coarsely; it was chosen by hand."""
SHORTEST_M = 1e-9
"""Shortest range that is divided into cells [m]. Smaller divides by next to nothing, larger refuses
the travel of very fine stages. Chosen by hand."""
COUNTS = (8, 16, 30)
"""Basis functions over the travel with which diagnosis tries a shape, one after the other. More, or
finer ones, take time and follow noise, fewer miss short structure. Chosen by hand: 5, 13 and 27
cells, each more than twice as many as before."""


def _in_order(knots: tuple[float, float, int]) -> tuple[float, float, int]:
    low, high, count = knots
    if high - low < SHORTEST_M:
        raise ValueError(f"from {low:g} to {high:g} m; the first must lie below the second")
    if not FEWEST <= count <= MOST:
        raise ValueError(f"{count} functions; must be {FEWEST} to {MOST}")
    return knots


Finite = Annotated[float, Field(allow_inf_nan=False)]
Knots = Annotated[tuple[Finite, Finite, int], AfterValidator(_in_order)]
"""Lowest position [m], highest position [m], number of basis functions between them."""


@cache  # a search asks for them thousands of times
def spline_parameters(symbol: str, functions: int) -> tuple[Parameter, ...]:
    """Return a parameter for each spline but the last: all together are a constant.

    Parameters
    ----------
    symbol
        Letter of their symbols.
    functions
        How many splines there are.

    Returns
    -------
    tuple
        In the order of the splines.
    """
    return tuple(
        Parameter(f"knot_{j}", f"{symbol}_{j}", "V", -1e3, 1e3, 0.0, 1.0)
        for j in range(functions - 1)
    )


def spline_constants(knots: Knots | None) -> tuple[float, float, float]:
    """Return lowest position [m], cells per metre and number of functions; 0 functions for None."""
    if knots is None:
        return 0.0, 0.0, 0.0
    low, high, count = knots
    return low, (count - 3) / (high - low), float(count)


def finer_knots(knots: Knots | None, spans: Spans) -> list[Knots]:
    """Return the divisions of the used travel that have more functions than `knots`."""
    if spans.travel_m < SHORTEST_M:
        return []
    now = 0 if knots is None else knots[2]
    return [(*spans.position_m, count) for count in COUNTS if count > now]


@inner_kernel(error_model="numpy")
def basis(j: int, x: float, low: float, cells_per_m: float, count: float) -> float:
    """Return the j-th of `count` cubic B-splines at x [m]; constant beyond the ends.

    Together they are 1 everywhere (de Boor, A Practical Guide to Splines, 1978).
    """
    place = min(max((x - low) * cells_per_m, 0.0), count - 3.0)
    d = abs(place + 1.0 - j)
    if d < 1.0:
        return (4.0 - 6.0 * d * d + 3.0 * d * d * d) / 6.0
    if d < 2.0:
        return (2.0 - d) ** 3 / 6.0
    return 0.0
