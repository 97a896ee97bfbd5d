"""The inverse of the input map: the command u whose v(u) is the virtual command."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from motorctl.kernels import inner_kernel

MAX_ITERATIONS = 60


@inner_kernel
def invert(
    input_map: Callable[..., float],
    input_slope: Callable[..., float],
    v: float,
    x: float,
    vs: float,
    t: float,
    context: Any,
    theta: Any,
    u_max: float,
) -> float:
    """Solve v = input_map(u; x, vs, t, context) for u on the monotonic branch [-u_max, u_max].

    Newton from u0 = v, kept inside a bracket by bisection (Cardano's formula loses digits as
    theta6 goes to zero). Chen, Yao, Wang 2013, eq. 9; Assumption 2 makes the root unique.

    Parameters
    ----------
    input_map, input_slope
        Kernels of the axis' list of effects.
    v
        Virtual command [V].
    x, vs, t
        Desired position [m], velocity [m/s] and time [s], for maps that vary with them.
    context
        The effects' memories after the last command, from which the map is a function of u.
    theta
        Parameters, shape (n,).
    u_max
        End of the branch [V].

    Returns
    -------
    float
        The command u [V]; the nearer end where v is beyond the branch, nan where v or theta is.
    """
    low, high = -u_max, u_max
    v_low, v_high = (
        input_map(low, x, vs, t, context, theta),
        input_map(high, x, vs, t, context, theta),
    )
    if v >= v_high:
        return high
    if v <= v_low:
        return low
    if not v_low < v < v_high:
        return math.nan
    u = min(max(v, low), high)
    for _ in range(MAX_ITERATIONS):
        excess = input_map(u, x, vs, t, context, theta) - v
        if excess == 0.0:
            return u
        if excess > 0.0:
            high = u
        else:
            low = u
        slope = input_slope(u, x, vs, t, context, theta)
        step = excess / slope if slope > 0.0 else u_max
        next_u = u - step
        if not low < next_u < high:
            next_u = 0.5 * (low + high)
        if abs(next_u - u) <= 4e-16 * (1.0 + abs(u)):
            return next_u
        u = next_u
    return u
