"""Point-to-point moves, as fast as the limits allow."""

from __future__ import annotations

from math import copysign, isfinite
from typing import Literal

import numpy as np
import ruckig
from pydantic import Field

from motorctl.errors import UsageError
from motorctl.motion.program import Coordinate, OneAxisProgram, Positive
from motorctl.motion.segments import Segments, jerk_segments
from motorctl.motion.trajectory import Trajectory

# Shorter moves are none: their phases would vanish in rounding.
NEGLIGIBLE_M = 1e-12


def point_to_point(
    start_m: float,
    target_m: float,
    max_velocity_m_s: float,
    max_acceleration_m_s2: float,
    max_jerk_m_s3: float,
) -> Trajectory:
    """Plan the time-optimal jerk-limited move from rest to rest.

    Parameters
    ----------
    start_m, target_m
        Begin and end [m].
    max_velocity_m_s, max_acceleration_m_s2, max_jerk_m_s3
        Limits, all above 0.

    Returns
    -------
    Trajectory
        Position [m], velocity, acceleration and jerk over time [s]; a rest where the way is
        negligible.

    Raises
    ------
    UsageError
        Where a limit is not positive or a number is not finite.
    """
    if abs(target_m - start_m) < NEGLIGIBLE_M:
        return Trajectory.at_rest(target_m)
    return Trajectory(
        move_segments(start_m, target_m, max_velocity_m_s, max_acceleration_m_s2, max_jerk_m_s3)
    )


def move_segments(
    start_m: float,
    target_m: float,
    max_velocity_m_s: float,
    max_acceleration_m_s2: float,
    max_jerk_m_s3: float,
) -> Segments:
    """Return the phases of constant jerk of `point_to_point`'s move between distinct points."""
    distance = abs(target_m - start_m)
    limits = max_velocity_m_s, max_acceleration_m_s2, max_jerk_m_s3
    if not (isfinite(distance) and all(isfinite(limit) and limit > 0 for limit in limits)):
        raise _no_move(start_m, target_m, limits, "needs finite points and limits above 0")
    # ruckig's tolerances are absolute, so it is asked for the same move with a distance of one
    # and a jerk of one: in micrometres it would fail, or find no motion at all.
    unit_s = (distance / max_jerk_m_s3) ** (1 / 3)
    request = ruckig.InputParameter(1)
    request.current_position, request.target_position = [0.0], [1.0]
    request.max_velocity = [max_velocity_m_s * unit_s / distance]
    request.max_acceleration = [max_acceleration_m_s2 * unit_s**2 / distance]
    request.max_jerk = [1.0]
    plan = ruckig.Trajectory(1)
    try:
        result = ruckig.Ruckig(1).calculate(request, plan)
    except ruckig.RuckigError as error:
        raise _no_move(start_m, target_m, limits, str(error)) from error
    if result != ruckig.Result.Working:
        raise _no_move(start_m, target_m, limits, str(result))
    profile = plan.profiles[0][0]
    jerk = copysign(max_jerk_m_s3, target_m - start_m)
    return jerk_segments(
        start_m, target_m, np.array(profile.t) * unit_s, np.array(profile.j) * jerk
    )


def _no_move(
    start_m: float, target_m: float, limits: tuple[float, float, float], why: str
) -> UsageError:
    v, a, j = limits
    return UsageError(
        f"no move from {start_m:g} to {target_m:g} m with at most {v:g} m/s, {a:g} m/s^2, "
        f"{j:g} m/s^3: {why}"
    )


class PointToPoint(OneAxisProgram):
    """One move from rest at `start_m` to rest at `target_m`, as fast as the limits allow."""

    kind: Literal["point_to_point"] = Field(
        default="point_to_point", description="one jerk-limited move"
    )
    start_m: Coordinate = Field(description="position at its begin, at rest")
    target_m: Coordinate = Field(description="position at its end, at rest")
    max_velocity_m_s: Positive = Field(description="speed that is not exceeded")
    max_acceleration_m_s2: Positive = Field(description="acceleration that is not exceeded")
    max_jerk_m_s3: Positive = Field(description="jerk that is not exceeded")

    @property
    def cycles(self) -> int:
        """Once."""
        return 1

    @property
    def period_s(self) -> None:
        """Not periodic."""

    def trajectories(self) -> dict[str, Trajectory]:
        """Plan the move."""
        move = point_to_point(
            self.start_m,
            self.target_m,
            self.max_velocity_m_s,
            self.max_acceleration_m_s2,
            self.max_jerk_m_s3,
        )
        return {self.axis: move}
