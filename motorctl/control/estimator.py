"""Least squares with forgetting on filtered, time-aligned signals, in UD form."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from motorctl.control.law_records import HISTORY, LawFlag
from motorctl.control.projection import project, violates
from motorctl.kernels import inner_kernel

ADAPTED = int(LawFlag.ADAPTED)
PROJECTED = int(LawFlag.PROJECTED)
WARM_UP = 3
"""Steps until two past positions are known."""


@inner_kernel
def remember_command(
    input_columns: Callable[..., None],
    advance_inputs: Callable[..., None],
    settings: Any,
    state: Any,
    u: float,
    x: float,
    vs: float,
    t: float,
) -> None:
    """Keep the input columns of the command that is about to be applied, and the command.

    x [m], vs [m/s] and t [s]: where, how fast and when it acts. Behind a declared lag it is what
    acts in the mean of the period that is kept, exactly discretised: the columns see what the force
    is made of. What the input effects remember is taken on to what acts at the end of the period.
    """
    n = settings.n
    acts = u
    if settings.lag_s > 0.0:
        behind = state.lagged - u
        state.lagged = u + behind * settings.lag_decay
        u += behind * settings.lag_mean
        acts = state.lagged
    entry = state.history[state.steps % HISTORY]
    input_columns(u, x, vs, t, state.context1, entry)
    advance_inputs(acts, settings.period_s, state.context1)
    entry[n] = u


@inner_kernel
def _align_inputs(settings: Any, state: Any) -> None:
    """Put the delayed mean of the last two commands' columns into state.row.

    The second difference of the position is centred one tick ago and sees the commands of the
    last two ticks with equal weight; the delay shifts both.
    """
    n = settings.n
    newest = state.steps - 1 - settings.delay_ticks
    part = settings.delay_fraction
    now = state.history[newest % HISTORY]
    before = state.history[(newest - 1) % HISTORY]
    oldest = state.history[(newest - 2) % HISTORY]
    for i in range(n + 1):
        state.row[i] += 0.5 * ((1.0 - part) * now[i] + before[i] + part * oldest[i])


@inner_kernel
def _low_pass(pole: float, stage1: Any, stage2: Any, i: int, value: float) -> float:
    """Pass a value through two equal poles and return the filtered one."""
    stage1[i] += (1.0 - pole) * (value - stage1[i])
    stage2[i] += (1.0 - pole) * (stage1[i] - stage2[i])
    return stage2[i]  # type: ignore[no-any-return]


@inner_kernel(error_model="numpy")
def adapt(
    state_columns: Callable[..., None],
    settings: Any,
    state: Any,
    y: float,
) -> int:
    """Take the data of one tick into the estimate and return what was done as LawFlag bits.

    Chen, Yao, Wang 2013, eqs 25-28, exactly discretised: with kappa = Ts / (1 + nu psi^T Gamma
    psi) and lambda = exp(-alpha Ts), K = kappa Gamma psi / (lambda + kappa psi^T Gamma psi).
    Explicit Euler of the same equations is unstable where Ts psi^T Gamma psi > 1, and with the
    published Gamma(0) it comes to 1.8. Bierman's UD form keeps Gamma positive definite.
    """
    n, ts = settings.n, settings.period_s
    if state.steps < WARM_UP + settings.delay_ticks:
        return 0
    velocity = (y - state.y2) / (2.0 * ts)
    acceleration = (y - 2.0 * state.y1 + state.y2) / (ts * ts)
    state_columns(state.y1, velocity, acceleration, state.vd1, state.t1, state.context1, state.row)
    state.row[n] = 0.0
    _align_inputs(settings, state)
    pole = settings.filter_pole
    for i in range(n + 1):
        state.row[i] = _low_pass(pole, state.stage1, state.stage2, i, state.row[i])
    state.stage1_v += (1.0 - pole) * (velocity - state.stage1_v)
    state.stage2_v += (1.0 - pole) * (state.stage1_v - state.stage2_v)
    state.stage1_a += (1.0 - pole) * (acceleration - state.stage1_a)
    state.stage2_a += (1.0 - pole) * (state.stage1_a - state.stage2_a)
    if (
        abs(state.stage2_v) <= settings.gate_velocity_m_s
        and abs(state.stage2_a) <= settings.gate_acceleration_m_s2
    ):
        return 0

    U, D, row, f, g = state.U, state.D, state.row, state.f, state.g
    residual = row[n]
    spread = 0.0
    for j in range(n):
        residual -= row[j] * state.theta[j]
        total = row[j]
        for i in range(j):
            total += U[i, j] * row[i]
        f[j] = total
        g[j] = D[j] * total
        spread += total * g[j]

    forgetting = settings.forgetting
    for i in range(n):
        diagonal = D[i]
        for k in range(i + 1, n):
            diagonal += U[i, k] * U[i, k] * D[k]
        if diagonal > settings.covariance_limit[i]:
            forgetting = 1.0
    kappa = ts / (1.0 + settings.normalisation * spread)
    noise = forgetting / kappa

    rate = 0.0
    for i in range(n):
        total = g[i]
        for k in range(i + 1, n):
            total += U[i, k] * g[k]
        state.gain[i] = total * residual / (noise + spread)
        rate += state.gain[i] ** 2 / settings.covariance[i]
    rate = math.sqrt(rate) / ts
    if not math.isfinite(rate):
        return 0
    if rate > settings.rate_limit_1_s:
        for i in range(n):
            state.theta[i] += state.gain[i] * settings.rate_limit_1_s / rate
    else:
        for i in range(n):
            state.theta[i] += state.gain[i]
        _update_covariance(settings, state, noise, forgetting)
    if violates(settings, state.theta):
        project(settings, state)
        return ADAPTED | PROJECTED
    return ADAPTED


@inner_kernel(error_model="numpy")
def _update_covariance(settings: Any, state: Any, noise: float, forgetting: float) -> None:
    """Bierman's measurement update of U and D, then the forgetting."""
    U, D, f, g, b = state.U, state.D, state.f, state.g, state.gain
    before = noise
    for j in range(settings.n):
        after = before + f[j] * g[j]
        D[j] *= before / (after * forgetting)
        b[j] = g[j]
        factor = -f[j] / before
        for i in range(j):
            old = U[i, j]
            U[i, j] = old + b[i] * factor
            b[i] += old * g[j]
        before = after
