"""DCDIARC: desired-compensation direct/indirect adaptive robust control over a list of effects.

One law serves C1 and C2: they differ in the list that the model's kernels were composed from.
Source: Z. Chen, B. Yao, Q. Wang, IEEE/ASME Trans. Mechatronics 18(3), 2013, pp. 1122-1129.

Where the list declares a lag or a delay of the command, the model is evaluated when the command
will act, and led by the lag; the rest of the law is the same. The measured velocity is set against
the mean desired one over the same period (`matched`), or against the desired one now (published).
Where `settings.filters`, va2 + vs goes through a filter of second order, as published it does not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorctl.control.command_filter import filtered, settle_filter, shift_filter
from motorctl.control.estimator import adapt, remember_command
from motorctl.control.inverse import invert
from motorctl.control.law_records import LawFlag
from motorctl.kernels import inner_kernel

SATURATED = int(LawFlag.SATURATED)
LONG_S = 1e3
"""How long a command has been standing for effects that remember it, where a model takes over [s].
Any other would do that is long beside a drive's memory. By hand."""


@inner_kernel
def start_law(
    feedforward: Callable[..., float],
    advance_context: Callable[..., None],
    settings: Any,
    state: Any,
    t: float,
    y: float,
) -> None:
    """Begin at rest at position y without a bump; the estimate is kept as it is.

    The fast adaptation starts where it cancels what the model compensates at rest, so that the
    first virtual command is zero. `state.others` and `state.others_far` are filled before.
    """
    state.y1, state.y2, state.xd1, state.vd1, state.t1 = y, y, y, 0.0, t
    for i in range(settings.motion_memory, state.context.size):
        state.context[i], state.context1[i] = 0.0, 0.0  # no command has acted
    _settle_contexts(advance_context, settings, state, y)
    at_rest = _at_rest(feedforward, settings, state, t, y)
    state.d0 = min(max(at_rest, -settings.d_hat_max_v), settings.d_hat_max_v)
    settle_filter(settings, state, -state.d0)
    state.u, state.v, state.flags, state.steps = 0.0, 0.0, 0, 0
    state.lagged = 0.0
    for i in range(settings.n + 1):
        state.stage1[i], state.stage2[i] = 0.0, 0.0
    state.stage1_v, state.stage2_v, state.stage1_a, state.stage2_a = 0.0, 0.0, 0.0, 0.0


@inner_kernel
def _settle_contexts(
    advance_context: Callable[..., None], settings: Any, state: Any, y: float
) -> None:
    """Let the memories of the motion begin at rest at position y: a first motion has dt = 0."""
    for i in range(settings.motion_memory):
        state.context[i], state.context1[i] = 0.0, 0.0
    advance_context(y, 0.0, 0.0, 0.0, state.others_far, state.context)
    advance_context(y, 0.0, 0.0, 0.0, state.others, state.context1)


@inner_kernel
def _at_rest(
    feedforward: Callable[..., float], settings: Any, state: Any, t: float, y: float
) -> float:
    """Return what the model compensates at rest at y."""
    acts = t + settings.preview_s - 0.5 * settings.period_s if settings.previews else t
    return feedforward(y, 0.0, 0.0, 0.0, acts, state.context, state.theta)


@inner_kernel
def shift_law(
    feedforward: Callable[..., float],
    advance_context: Callable[..., None],
    settings: Any,
    state: Any,
    t: float,
    y: float,
    shift: float,
) -> None:
    """Move a law that holds at rest at position y to new coordinates, y + shift, without a bump.

    The fast adaptation takes up what the model compensates differently there.
    """
    before = _at_rest(feedforward, settings, state, t, y)
    state.y1 += shift
    state.y2 += shift
    state.xd1 += shift
    _settle_contexts(advance_context, settings, state, y + shift)
    after = _at_rest(feedforward, settings, state, t, y + shift)
    d0 = state.d0
    state.d0 = min(max(d0 + (after - before), -settings.d_hat_max_v), settings.d_hat_max_v)
    shift_filter(settings, state, d0 - state.d0)


@inner_kernel
def still_command(
    input_map: Callable[..., float],
    input_slope: Callable[..., float],
    settings: Any,
    state: Any,
    t: float,
) -> float:
    """Return what a law at rest commands [V] where its position stays as it was measured last.

    That is its last command without what it gave for the speed: one step of the count is a speed
    for one tick, and no part of what holds the axis.
    """
    rate = (state.y1 - state.y2) / settings.period_s
    v = state.v + settings.ks_v_s_m * rate
    if settings.filters:  # it gives as much as it is given, as soon as nothing moves
        v += state.feedback - state.filtered
    return invert(
        input_map, input_slope, v, state.xd1, 0.0, t, state.context, state.theta,
        settings.max_voltage_v,
    )  # fmt: skip


@inner_kernel
def take_over_law(
    feedforward: Callable[..., float],
    input_map: Callable[..., float],
    advance_context: Callable[..., None],
    advance_inputs: Callable[..., None],
    settings: Any,
    state: Any,
    before: Any,
    u: float,
    t: float,
) -> bool:
    """Go on at rest where the law of another model left off, with the command u that held the axis.

    The fast adaptation takes up what the two models compensate differently there. `state` is that
    of the new model, of which `others` and `others_far` are filled, `before` that of the old one.

    Parameters
    ----------
    u
        The old law's `still_command` [V].

    Returns
    -------
    bool
        Whether the fast adaptation may be as much as that; else nobody shall go on with `state`.
    """
    x = before.xd1
    start_law(feedforward, advance_context, settings, state, t, x)
    at_rest = _at_rest(feedforward, settings, state, t, x)
    state.y1, state.y2, state.xd1, state.t1 = before.y1, before.y2, x, before.t1
    # What remembers commands has had this one for as long as the axis stands.
    advance_inputs(u, LONG_S, state.context)
    advance_inputs(u, LONG_S, state.context1)
    v = input_map(u, x, 0.0, t, state.context, state.theta)
    d0 = at_rest - settings.ks_v_s_m * settings.k1_1_s * (before.y1 - x) - v
    state.d0 = min(max(d0, -settings.d_hat_max_v), settings.d_hat_max_v)
    settle_filter(settings, state, v - at_rest)
    state.u, state.v, state.lagged = u, v, u
    state.blind = before.blind
    return state.d0 == d0  # type: ignore[no-any-return]


@inner_kernel(error_model="numpy")
def carry_over_gap(
    advance_context: Callable[..., None],
    advance_inputs: Callable[..., None],
    settings: Any,
    state: Any,
    elapsed: int,
    y: float,
    xd: float,
) -> None:
    """Spread the motion of `elapsed` periods evenly, and let the estimator warm up again.

    After skipped periods one period's differences would read as several times the speed.
    """
    state.y1 = y - (y - state.y1) / elapsed
    state.xd1 = xd - (xd - state.xd1) / elapsed
    skipped = elapsed - 1
    passed_s = skipped * settings.period_s
    # The last command was held meanwhile.
    state.lagged = state.u + (state.lagged - state.u) * settings.lag_decay**skipped
    advance_inputs(state.u, passed_s, state.context)
    acts = state.lagged if settings.lag_s > 0.0 else state.u
    advance_inputs(acts, passed_s, state.context1)
    if settings.previews:
        near = state.near
        advance_context(near[0], near[1], near[2], passed_s, state.others_far, state.context)
    state.steps = 0


@inner_kernel(error_model="numpy")
def law_step(
    state_columns: Callable[..., None],
    input_columns: Callable[..., None],
    feedforward: Callable[..., float],
    input_map: Callable[..., float],
    input_slope: Callable[..., float],
    advance_context: Callable[..., None],
    advance_inputs: Callable[..., None],
    settings: Any,
    state: Any,
    t: float,
    y: float,
    xd: float,
    vd: float,
    ad: float,
) -> float:
    """Return the command u [V] for this tick and learn from the last ones.

    eqs 9-19: v = va1 + va2 + vs with va1 the model at the desired motion, va2 = -d0_hat the fast
    adaptation and vs = -ks p, p = de/dt + k1 e; then u = the root of v(u) = v. `state.learned_v`,
    which is no part of the law, is added to that.

    `state.others` is filled before; where the list declares a lag or a delay, so are
    `state.near` and `state.far`, the desired motion while the command acts. Then va1 is the mean of
    the model over that time, led by the lag.

    Parameters
    ----------
    state_columns, input_columns, feedforward, input_map, input_slope, advance_context
        Kernels of the axis' list of effects.
    settings, state
        Records of `law_settings` and `law_state`.
    t
        Time [s].
    y
        Measured position [m].
    xd, vd, ad
        Desired position, velocity and acceleration at time t [m, m/s, m/s^2].
    """
    ts, theta = settings.period_s, state.theta
    if settings.previews:
        near, far, lead = state.near, state.far, settings.lag_s / ts
        begins = t + settings.act_delay_s
        before = feedforward(near[0], near[1], near[2], near[1], begins, state.context, theta)
        advance_context(far[0], far[1], far[2], ts, state.others_far, state.context)
        after = feedforward(far[0], far[1], far[2], far[1], begins + ts, state.context, theta)
        va1 = 0.5 * (before + after) + lead * (after - before)
        acts_x, acts_v = 0.5 * (near[0] + far[0]), 0.5 * (near[1] + far[1])
        map_x, map_v = acts_x + lead * (far[0] - near[0]), acts_v + lead * (far[1] - near[1])
        acts_t = begins + 0.5 * ts
        map_t = acts_t + settings.lag_s
    else:
        advance_context(xd, vd, ad, t - state.t1, state.others, state.context)
        va1 = feedforward(xd, vd, ad, vd, t, state.context, theta)
        acts_x, acts_v, acts_t, map_x, map_v, map_t = xd, vd, t, xd, vd, t
    # As published, the measured velocity is half a period older than the desired one.
    desired = (xd - state.xd1) / ts if settings.matched else vd
    rate = (y - state.y1) / ts - desired
    p = rate + settings.k1_1_s * (y - xd)
    if settings.filters:
        v = va1 + filtered(settings, state, -state.d0 - settings.ks_v_s_m * p)
    else:
        v = va1 - state.d0 - settings.ks_v_s_m * p
    context = state.context
    u = invert(
        input_map, input_slope, v, map_x, map_v, map_t, context, theta, settings.max_voltage_v
    )
    if state.learned_v != 0.0:  # before the law remembers its command: the estimate sees it whole
        u = min(max(u + state.learned_v, -settings.max_voltage_v), settings.max_voltage_v)
    advance_inputs(u, ts, context)
    flags = SATURATED if abs(u) >= settings.max_voltage_v else 0

    # d0_hat' = Proj(gamma_d p), eqs 18-19; frozen while it would push further into saturation.
    push = settings.gamma_d * p
    if not (flags and push * u < 0.0):
        state.d0 = min(max(state.d0 + ts * push, -settings.d_hat_max_v), settings.d_hat_max_v)

    if settings.enabled:
        if not state.blind:
            flags |= adapt(state_columns, settings, state, y)
        remember_command(input_columns, advance_inputs, settings, state, u, acts_x, acts_v, acts_t)
    # The estimator looks at the motion of one tick ago: this one's memories are for the next.
    advance_context(xd, vd, ad, t - state.t1, state.others, state.context1)
    state.y2, state.y1, state.xd1, state.vd1, state.t1 = state.y1, y, xd, vd, t
    state.steps += 1
    state.u, state.v, state.flags = u, v, flags
    return u
