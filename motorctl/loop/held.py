"""Ticks without a new sample: the last position is held, or the model moves it on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from numba import njit

from motorctl.log.sample import AxisState

OFF = int(AxisState.OFF)
FAULT = int(AxisState.FAULT)


@njit(error_model="numpy")
def predict_motion(
    feedforward: Callable[..., float], settings: Any, axis: Any, law: Any, elapsed: int, t: float
) -> tuple[float, float]:
    """Give the position and the velocity that the model expects now.

    It solves the force balance of the list, under the last virtual command, for the acceleration:
    v + d0_hat = theta1 a + the rest of the list at the last x and v.
    """
    dt = elapsed * settings.period_s
    x, v = axis.position_m, axis.velocity_m_s
    if not axis.held_ticks:
        v = axis.reference_velocity_m_s + axis.drift_m_s
    rest = feedforward(x, v, 0.0, v, t, law.context, law.theta)
    inertia = feedforward(x, v, 1.0, v, t, law.context, law.theta) - rest
    a = (law.v + law.d0 - rest) / inertia
    bound = settings.max_acceleration_m_s2
    a = min(max(a, -bound), bound) if math.isfinite(a) else 0.0
    return x + dt * (v + 0.5 * dt * a), v + dt * a


@njit
def predicts(settings: Any, axis: Any) -> bool:
    """Tell whether the model stands in for samples that do not come."""
    moving = axis.state not in (OFF, FAULT) and not axis.fresh
    return settings.predict and axis.have_counts and moving


@njit
def hold_position(
    feedforward: Callable[..., float], settings: Any, axis: Any, law: Any, elapsed: int, t: float
) -> None:
    """Do without a new sample: the last position stands, or the model moves it on."""
    if predicts(settings, axis):
        x, v = predict_motion(feedforward, settings, axis, law, elapsed, t)
        axis.position_m, axis.velocity_m_s = x, v
    axis.held_ticks += elapsed
    axis.blind_ticks += elapsed
    if not axis.have_counts:  # there is no last position
        axis.held_ticks = max(axis.held_ticks, settings.hold_ticks + 1)
