"""How far the skew loop lets a beam go askew: while it is squared, and where its ends differ."""

from __future__ import annotations

import math
from dataclasses import dataclass

from motorctl.config.analysis.sampled_loop import Array, DelayedPlant

PARTS = 10
"""Of a period, in which the motion between two samples is reckoned. Fewer tell less exactly when
friction gives way, more only take longer. By hand."""
MOST_PERIODS = 20_000
"""Periods that are looked at. Fewer miss what comes later, more take longer. By hand: 4 s of
5 kHz."""


@dataclass(frozen=True)
class SkewPlant:
    """What resists skew, inertia s'' + damping s' + stiffness s = du, and the loop of du."""

    inertia_v_s2_m: float
    damping_v_s_m: float
    stiffness_v_m: float
    k1_1_s: float
    ks_v_s_m: float
    gamma_d: float
    period_s: float


class _Loop:
    """The skew loop's part of a tick: du = -ks p - d, dd/dt = gamma_d p."""

    def __init__(self, plant: SkewPlant) -> None:
        self._plant = plant
        self._last_m, self._d_v = 0.0, 0.0

    def command_v(self, error_m: float) -> float:
        """Return du for the skew's error [m]."""
        plant = self._plant
        p = (error_m - self._last_m) / plant.period_s + plant.k1_1_s * error_m
        self._last_m = error_m
        du_v = -plant.ks_v_s_m * p - self._d_v
        self._d_v += plant.period_s * plant.gamma_d * p
        return du_v


def squaring_lag_m(plant: SkewPlant, velocity_m_s: float, friction_v: float, way_m: float) -> float:
    """Return how far a beam stays behind at most that is led to square from rest [m].

    Nothing but inertia, damping and dry friction resists: a spring would pull it along, or back.

    Parameters
    ----------
    plant
        The skew and its loop.
    velocity_m_s
        At which it is led.
    friction_v
        Dry friction that both ends have to overcome, as a command [V].
    way_m
        How far it is led.
    """
    part_s, loop = plant.period_s / PARTS, _Loop(plant)
    slowed = 1.0 + part_s * plant.damping_v_s_m / plant.inertia_v_s2_m
    held = part_s * friction_v / plant.inertia_v_s2_m / slowed
    skew_m = speed_m_s = lag_m = 0.0
    periods = min(int(way_m / (velocity_m_s * plant.period_s)), MOST_PERIODS)
    for k in range(1, periods + 1):
        error_m = skew_m - k * velocity_m_s * plant.period_s
        lag_m = max(lag_m, abs(error_m))
        du_v = loop.command_v(error_m)
        for _ in range(PARTS):
            free = (speed_m_s + part_s * du_v / plant.inertia_v_s2_m) / slowed
            speed_m_s = math.copysign(max(abs(free) - held, 0.0), free)
            skew_m += part_s * speed_m_s
    return lag_m


def skew_of_m(plant: SkewPlant, push_v: Array) -> float:
    """Return how far a beam is askew at most that is pushed so [m].

    Parameters
    ----------
    plant
        The skew and its loop.
    push_v
        What pushes its first end ahead and its second back, as commands [V], (periods,).
    """
    balance = (plant.inertia_v_s2_m, plant.damping_v_s_m, plant.stiffness_v_m)
    held = DelayedPlant(balance, plant.period_s)
    (xx, xv), (vx, vv) = held.phi.tolist()
    xu, vu = (held.prompt + held.late).tolist()
    loop, x, v, most_m = _Loop(plant), 0.0, 0.0, 0.0
    for push in push_v[:MOST_PERIODS].tolist():
        u = loop.command_v(x) + push
        x, v = xx * x + xv * v + xu * u, vx * x + vv * v + vu * u
        most_m = max(most_m, abs(x))
    return most_m
