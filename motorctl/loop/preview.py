"""The desired motion of the near future, and of other axes: what the law's model looks at."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.loop.states import State, is_stopping
from motorctl.motion import advance, evaluate, velocity_ramp_step


@inner_kernel
def fill_motion(
    law_settings: Any,
    laws: Any,
    settings: Any,
    axes: Any,
    segments: Any,
    counts: Any,
    beside: Any,
    tick: int,
    i: int,
) -> None:
    """Tell the law of axis i the desired motion that its effects depend on besides its own now.

    beside[i] (axes) are the axes that its list names, -1 where no more. An axis of a slower driver
    stands where its last tick put it.
    """
    law, own_s, tick_s = laws[i], law_settings[i].period_s, settings[i].tick_s
    ahead_s = 0.0
    if law_settings[i].previews:
        ahead_s = law_settings[i].preview_s
        _look_ahead(tick_s, axes[i], segments[i], counts[i], tick, ahead_s - own_s, law.near)
        _look_ahead(tick_s, axes[i], segments[i], counts[i], tick, ahead_s, law.far)
    for k in range(beside.shape[1]):
        j = beside[i, k]
        if j < 0:
            break
        _look_ahead(tick_s, axes[j], segments[j], counts[j], tick, 0.0, law.others[k])
        _look_ahead(tick_s, axes[j], segments[j], counts[j], tick, ahead_s, law.others_far[k])


@inner_kernel
def _look_ahead(
    tick_s: float, axis: Any, segments: Any, counts: Any, tick: int, ahead_s: float, motion: Any
) -> None:
    """Return desired x, v, a `ahead_s` from now, so far as it is decided now.

    A program is looked up, a ramp is continued, and an axis that holds goes on holding. A change
    that comes from outside, such as a stop, is not known before it comes.
    """
    x, v, a = axis.reference_m, axis.reference_velocity_m_s, axis.reference_acceleration_m_s2
    if ahead_s > 0.0 and axis.state == State.FOLLOWING:
        table, count = segments[axis.slot], counts[axis.slot]
        passed_s = ahead_s - max(axis.start_tick - tick, 0) * tick_s
        if passed_s > 0.0:
            index, time_s, done = advance(table, count, axis.segment, axis.segment_time_s, passed_s)
            x, v, a = evaluate(table, count, index, time_s)
            if done:
                v, a = 0.0, 0.0
    elif ahead_s > 0.0 and (axis.state == State.HOMING or is_stopping(axis)):
        v, a, dx = velocity_ramp_step(
            v, a, axis.ramp_velocity_m_s, axis.ramp_acceleration_m_s2, axis.ramp_jerk_m_s3, ahead_s
        )
        x += dx
    motion[0], motion[1], motion[2] = x, v, a
