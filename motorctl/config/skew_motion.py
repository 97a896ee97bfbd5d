"""How far the skew loop lets a beam go askew: while it is squared, and where its ends differ."""

from __future__ import annotations

import math

from motorctl.config.analysis.sampled_loop import Array, DelayedPlant
from motorctl.config.dual_drive_keys import DualDrive, SkewLoop

PARTS = 10
"""Of a period, in which the motion between two samples is reckoned. Fewer tell less exactly when
friction gives way, more only take longer. By hand."""
MOST_PERIODS = 20_000
"""Periods that are looked at. Fewer miss what comes later, more take longer. By hand: 4 s of
5 kHz."""


class _Loop:
    """The skew loop's part of a tick: du = -ks p - d, dd/dt = gamma_d p."""

    def __init__(self, skew: SkewLoop, period_s: float) -> None:
        self._skew, self._period_s = skew, period_s
        self._last_m, self._d_v = 0.0, 0.0

    def command_v(self, error_m: float) -> float:
        """Return du for the skew's error [m]."""
        skew = self._skew
        p = (error_m - self._last_m) / self._period_s + skew.k1_1_s * error_m
        self._last_m = error_m
        du_v = -skew.ks_v_s_m * p - self._d_v
        self._d_v += self._period_s * skew.gamma_d * p
        return du_v


def squaring_lag_m(dual: DualDrive, limit_m: float, friction_v: float, period_s: float) -> float:
    """Return how far a beam stays behind at most that is led to square from rest [m].

    It begins as far askew as it may stand. Nothing but inertia, damping and dry friction resists: a
    spring would pull it along, or back.

    Parameters
    ----------
    dual
        The two drives, and the loop of their skew.
    limit_m
        Of the skew guard [m].
    friction_v
        Dry friction that both ends have to overcome, as a command [V].
    period_s
        Of the axis [s].
    """
    skew, part_s = dual.skew, period_s / PARTS
    loop, inertia, velocity = _Loop(skew, period_s), skew.inertia_v_s2_m, skew.squaring_velocity_m_s
    slowed = 1.0 + part_s * skew.damping_v_s_m / inertia
    held = part_s * friction_v / inertia / slowed
    skew_m = speed_m_s = lag_m = 0.0
    way_m = max(dual.max_out_of_square_m or 0.0, limit_m)
    periods = min(int(way_m / (velocity * period_s)), MOST_PERIODS)
    for k in range(1, periods + 1):
        error_m = skew_m - k * velocity * period_s
        lag_m = max(lag_m, abs(error_m))
        du_v = loop.command_v(error_m)
        for _ in range(PARTS):
            free = (speed_m_s + part_s * du_v / inertia) / slowed
            speed_m_s = math.copysign(max(abs(free) - held, 0.0), free)
            skew_m += part_s * speed_m_s
    return lag_m


def skew_of_m(skew: SkewLoop, push_v: Array, period_s: float) -> float:
    """Return how far a beam is askew at most that is pushed so [m].

    Parameters
    ----------
    skew
        What resists, and the loop that holds it.
    push_v
        What pushes its first end ahead and its second back, as commands [V], (periods,).
    period_s
        Of the axis [s].
    """
    balance = (skew.inertia_v_s2_m, skew.damping_v_s_m, skew.stiffness_v_m)
    held = DelayedPlant(balance, period_s)
    (xx, xv), (vx, vv) = held.phi.tolist()
    xu, vu = (held.prompt + held.late).tolist()
    loop, x, v, most_m = _Loop(skew, period_s), 0.0, 0.0, 0.0
    for push in push_v[:MOST_PERIODS].tolist():
        u = loop.command_v(x) + push
        x, v = xx * x + xv * v + xu * u, vx * x + vv * v + vu * u
        most_m = max(most_m, abs(x))
    return most_m
