"""The jerk-limited change of velocity, one tick at a time: stopping, and searching for home.

A stop begins in any state, in the tick that asks for it, so it has to be planned inside the tick.
That rules ruckig out: its calls from Python make objects, raise exceptions and cannot be called
from compiled code. And a plan is not needed: the rest of a time-optimal change is the
time-optimal change from the state reached, so the closed form is evaluated anew each tick and
there is nothing to keep, nor to invalidate when the target changes on the way.
"""

from __future__ import annotations

from math import sqrt

from motorctl.kernels import inner_kernel


@inner_kernel
def _phases(
    v: float, a: float, v_target: float, max_acceleration: float, max_jerk: float
) -> tuple[float, float, float, float, float]:
    """Plan the time-optimal way from (v, a) to (v_target, 0) -> (t1, j1, t2, t3, j3).

    Jerk j1 for t1 [s] brings the acceleration to its peak, which is held for t2; jerk j3 for t3
    takes it to zero. An acceleration beyond the limit comes back to it at `max_jerk`.
    """
    # The velocity that is reached if the acceleration goes to zero at once tells which way the
    # peak lies; mirrored, it is always upwards.
    side = 1.0 if v_target - v >= a * abs(a) / (2.0 * max_jerk) else -1.0
    change, now = side * (v_target - v), side * a
    peak = sqrt(max(max_jerk * change + now * now / 2.0, 0.0))
    # Once the peak has been passed, rounding must not ask for a little more of it.
    peak = min(max(peak, now, 0.0), max_acceleration)
    first = abs(peak - now) / max_jerk
    first_jerk = max_jerk if peak > now else -max_jerk
    hold = 0.0
    if peak >= max_acceleration:
        rest = change - first * (now + peak) / 2.0 - peak * peak / (2.0 * max_jerk)
        hold = max(rest / peak, 0.0)
    return first, side * first_jerk, hold, peak / max_jerk, -side * max_jerk


@inner_kernel
def velocity_ramp_distance(
    v: float, a: float, v_target: float, max_acceleration: float, max_jerk: float
) -> float:
    """Return the distance [m] of the whole way from (v, a) to `v_target`."""
    t1, j1, t2, t3, j3 = _phases(v, a, v_target, max_acceleration, max_jerk)
    distance = 0.0
    for t, j in ((t1, j1), (t2, 0.0), (t3, j3)):
        distance += t * (v + t * (a / 2.0 + t * j / 6.0))
        v += t * (a + t * j / 2.0)
        a += t * j
    return distance


@inner_kernel
def velocity_ramp_step(
    v: float, a: float, v_target: float, max_acceleration: float, max_jerk: float, dt: float
) -> tuple[float, float, float]:
    """Go dt [s] along the time-optimal way to `v_target` [m/s] -> (v, a, dx), exactly integrated.

    From any v [m/s] and a [m/s^2], in the limits or not. Where the way ends within the step, the
    result is v_target and 0 to the bit, and dx [m] holds the stretch at v_target too.
    """
    t1, j1, t2, t3, j3 = _phases(v, a, v_target, max_acceleration, max_jerk)
    lands = t1 + t2 + t3 <= dt
    left, dx = dt, 0.0
    for t, j in ((t1, j1), (t2, 0.0), (t3, j3)):
        step = min(t, left)
        dx += step * (v + step * (a / 2.0 + step * j / 6.0))
        v += step * (a + step * j / 2.0)
        a += step * j
        left -= step
    if lands:
        return v_target, 0.0, dx + left * v_target
    return v, a, dx
