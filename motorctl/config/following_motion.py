"""How far the law leaves an axis behind in a program, though its model were exact.

As published, the law's measured velocity is half a period older than the desired one: while an axis
accelerates by a, it takes a Ts/2 of speed for lacking, and stands off by a Ts / (2 k1).
"""

from __future__ import annotations

import numpy as np

from motorctl.config.analysis.sampled_loop import Array, DelayedPlant
from motorctl.config.axis_keys import FollowingErrorLimit, Gains
from motorctl.config.skew_motion import MOST_PERIODS
from motorctl.motion import Program

NEAR = 3.0
"""Times what the law leaves an axis behind: a following error at rest below that is noted. The
published gantry is left behind by 2.7 times as much at its first acceleration, as no list there has
its cogging and its lag. Larger notes limits that nothing comes near to, smaller leaves such
machines out. Measured, rounded."""
OVERSHOOT = 2.0
"""Times what it settles at, an error is at most while it comes about. Larger only takes longer,
smaller may miss one that trips. Chosen by hand."""


class LawError:
    """What an axis whose model is exact is off its reference in one cycle of a program.

    Parameters
    ----------
    gains, inertia_v_s2_m
        Of the axis; inertia in V*s^2/m.
    program, axis
        What it follows.
    period_s
        Of the axis [s].
    least_m
        Errors that cannot come near to this are left 0 [m].
    """

    def __init__(
        self,
        gains: Gains,
        inertia_v_s2_m: float,
        program: Program,
        axis: str,
        period_s: float,
        least_m: float,
    ) -> None:
        trajectory = program.trajectories()[axis]
        ticks = min(round(trajectory.duration_s / program.cycles / period_s), MOST_PERIODS)
        self.error_m: Array = np.zeros(ticks)
        """At each tick [m], (N,)."""
        self.velocity_m_s: Array = np.zeros(ticks)
        """Desired, at each tick [m/s], (N,)."""
        if not ticks:
            return
        x, velocity_m_s, _ = trajectory.sample(period_s * np.arange(ticks + 1))
        self.velocity_m_s = velocity_m_s[1:]
        if gains.velocity == "published":
            lacking_m_s = self.velocity_m_s - np.diff(x) / period_s
            settled_m = np.abs(lacking_m_s).max(initial=0.0) / gains.k1_1_s
            if NEAR * OVERSHOOT * settled_m > least_m:
                self.error_m = _errors_m(gains, inertia_v_s2_m, lacking_m_s, period_s)

    @property
    def most_m(self) -> float:
        """The largest [m]."""
        return float(np.abs(self.error_m).max(initial=0.0))

    def trips(self, limit: FollowingErrorLimit, count_m: float, period_s: float) -> bool:
        """Return whether it trips the guard, as the loop reckons, though a count be lost of it."""
        allowed_m = limit.minimum_m + limit.per_velocity_s * np.abs(self.velocity_m_s) + count_m
        most, behind = round(limit.filter_time_s / period_s), 0
        for beyond in (np.abs(self.error_m) > allowed_m).tolist():
            behind = behind + 1 if beyond else max(behind - 1, 0)
            if behind > most:
                return True
        return False


def _errors_m(gains: Gains, inertia: float, lacking_m_s: Array, period_s: float) -> Array:
    """Lead a mass by the law's feedback alone, to which so much speed seems to be lacking."""
    held = DelayedPlant((inertia, 0.0, 0.0), period_s)
    (xx, xv), (vx, vv) = held.phi.tolist()
    xu, vu = (held.prompt + held.late).tolist()
    x = v = before = d0_v = 0.0
    errors = []
    for lacking in lacking_m_s.tolist():
        errors.append(x)
        p = (x - before) / period_s - lacking + gains.k1_1_s * x
        before, u = x, -gains.ks_v_s_m * p - d0_v
        d0_v += period_s * gains.gamma_d * p
        d0_v = min(max(d0_v, -gains.d_hat_max_v), gains.d_hat_max_v)
        x, v = xx * x + xv * v + xu * u, vx * x + vv * v + vu * u
    return np.array(errors)
