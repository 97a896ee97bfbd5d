"""DCDIARC: desired-compensation direct/indirect adaptive robust control over a list of effects.

One law serves C1 and C2: they differ in the list that the model's kernels were composed from.
Source: Z. Chen, B. Yao, Q. Wang, IEEE/ASME Trans. Mechatronics 18(3), 2013, pp. 1122-1129.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

from motorctl.control.estimator import adapt, remember_command
from motorctl.control.inverse import invert
from motorctl.control.records import LawFlag

SATURATED = int(LawFlag.SATURATED)


@njit
def start_law(
    feedforward: Callable[..., float], settings: Any, state: Any, t: float, y: float
) -> None:
    """Begin at rest at position y without a bump; the estimate is kept as it is.

    The fast adaptation starts where it cancels what the model compensates at rest, so that the
    first virtual command is zero.
    """
    state.y1, state.y2, state.vd1, state.t1 = y, y, 0.0, t
    at_rest = feedforward(y, 0.0, 0.0, 0.0, t, state.theta)
    state.d0 = min(max(at_rest, -settings.d_max), settings.d_max)
    state.u, state.v, state.flags, state.steps = 0.0, 0.0, 0, 0
    for i in range(settings.n + 1):
        state.stage1[i], state.stage2[i] = 0.0, 0.0
    state.stage1_v, state.stage2_v, state.stage1_a, state.stage2_a = 0.0, 0.0, 0.0, 0.0


@njit(error_model="numpy")
def carry_over_gap(state: Any, elapsed: int, y: float) -> None:
    """Spread the motion of `elapsed` periods evenly, and let the estimator warm up again.

    After skipped periods one period's differences would read as several times the speed.
    """
    state.y1 = y - (y - state.y1) / elapsed
    state.steps = 0


@njit(error_model="numpy")
def law_step(
    state_columns: Callable[..., None],
    input_columns: Callable[..., None],
    feedforward: Callable[..., float],
    input_map: Callable[..., float],
    input_slope: Callable[..., float],
    settings: Any,
    state: Any,
    t: float,
    y: float,
    xd: float,
    vd: float,
    ad: float,
) -> float:
    """Give the command u [V] for this tick and learn from the last ones.

    y is the measured position [m]; xd, vd, ad the desired motion at time t. eqs 9-19:
    v = va1 + va2 + vs with va1 the model at the desired motion, va2 = -d0_hat the fast
    adaptation and vs = -ks p, p = de/dt + k1 e; then u = the root of v(u) = v.
    """
    ts = settings.period_s
    # Velocity by difference of two positions, against the desired one: as published.
    p = (y - state.y1) / ts - vd + settings.k1 * (y - xd)
    va1 = feedforward(xd, vd, ad, vd, t, state.theta)
    v = va1 - state.d0 - settings.ks * p
    u = invert(input_map, input_slope, v, state.theta, settings.u_max)
    flags = SATURATED if abs(u) >= settings.u_max else 0

    # d0_hat' = Proj(gamma_d p), eqs 18-19; frozen while it would push further into saturation.
    push = settings.gamma_d * p
    if not (flags and push * u < 0.0):
        state.d0 = min(max(state.d0 + ts * push, -settings.d_max), settings.d_max)

    if settings.adapt:
        if not state.blind:
            flags |= adapt(state_columns, settings, state, y)
        remember_command(input_columns, settings, state, u)
    state.y2, state.y1, state.vd1, state.t1 = state.y1, y, vd, t
    state.steps += 1
    state.u, state.v, state.flags = u, v, flags
    return u  # type: ignore[no-any-return]
