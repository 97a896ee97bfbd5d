"""The skew loop of a dual drive: what the two motors get beyond the mean's command.

With e = s - s_ref and p = de/dt + k1 e: du = -ks p - d, dd/dt = gamma_d p. That is the feedback
part of the law (Chen, Yao, Wang 2013, eqs 11, 18) for a second coordinate. The first motor gets
u + du, the second u - du. du is found first, and the law has what is left of the voltage: a beam
that is pulled askew is held even where the mean's command stands at its limit.
"""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.guards.skew import check_skew, check_skew_command
from motorctl.loop.homing_ends import settle_ends
from motorctl.loop.states import is_enabled


@inner_kernel
def guide_skew(
    axis_settings: Any, settings: Any, axis: Any, dual: Any, elapsed: int, t: float
) -> None:
    """Move the skew's reference on by a tick, and check how far the ends are apart.

    A beam is held as it stands when its axis is started; one that knows what is square is led
    there slowly.
    """
    settle_ends(settings, axis, dual)
    if not is_enabled(axis):
        dual.unchecked = 1
    if axis.fresh or dual.unchecked:
        dual.reference_m = dual.skew_m
        dual.error_m, dual.d_v, dual.gap_ticks = 0.0, 0.0, 0
    elif dual.squared:
        most = settings.squaring_velocity_m_s * axis_settings.period_s * elapsed
        dual.reference_m -= min(max(dual.reference_m, -most), most)
    # A sample that the axis leaves out is no reason to trip either; if it is true, the next one is.
    if is_enabled(axis) and not axis.held_ticks:
        check_skew(axis_settings, settings, axis, dual, t)
        dual.unchecked = 0


@inner_kernel(error_model="numpy")
def hold_skew(
    axis_settings: Any,
    settings: Any,
    axis: Any,
    dual: Any,
    law_settings: Any,
    elapsed: int,
    t: float,
) -> None:
    """Compute du, before the law's step, and leave the law the rest of the voltage.

    Without a new sample the last du stands.
    """
    full = axis_settings.max_voltage_v
    law_settings.max_voltage_v = full
    if not is_enabled(axis):
        dual.command_v = 0.0
        return
    if axis.fresh:
        dual.command_v = 0.0
    elif axis.held_ticks:
        dual.gap_ticks += elapsed
    else:
        passed_s = (elapsed + dual.gap_ticks) * axis_settings.period_s
        dual.gap_ticks = 0
        error, limit = dual.skew_m - dual.reference_m, settings.max_voltage_v
        p = (error - dual.error_m) / passed_s + settings.k1_1_s * error
        dual.error_m = error
        du = -settings.ks_v_s_m * p - dual.d_v
        if not check_skew_command(axis, du, limit, t):
            dual.command_v = 0.0
            return
        dual.command_v = min(max(du, -limit), limit)
        push = settings.gamma_d * p
        if abs(du) < limit or du * push > 0.0:  # else it would push further into saturation
            dual.d_v = min(max(dual.d_v + passed_s * push, -limit), limit)
    law_settings.max_voltage_v = full - abs(dual.command_v)
