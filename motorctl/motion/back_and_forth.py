"""Back and forth between two points, with dwells: the motion of the published experiment.

The move's acceleration consists of two rectangular pulses (velocity is a trapezoid), convolved
with a box of the jerk time Tj: the pulses' edges become ramps with the slope a / Tj. The
convolution lengthens the move by Tj and keeps its distance.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from motorctl.motion.move import NEGLIGIBLE_M
from motorctl.motion.program import Coordinate, Cycles, OneAxisProgram, Positive, check_cycles
from motorctl.motion.segments import Segments, jerk_segments
from motorctl.motion.trajectory import Trajectory

# Two moves of seven phases, two dwells.
SEGMENTS_A_CYCLE = 16


def smoothed_trapezoid(
    start_m: float,
    end_m: float,
    max_velocity_m_s: float,
    max_acceleration_m_s2: float,
    jerk_time_s: float,
) -> Segments:
    """Make the move between two distinct points, in closed form.

    The jerk never exceeds max_acceleration / jerk_time. That needs at least the jerk time of
    cruise between the two pulses, or their ramps would add up; so a short move runs at a lower
    velocity. A pulse shorter than the jerk time keeps its slope and reaches a lower acceleration.
    """
    distance = abs(end_m - start_m)
    a, ramp = max_acceleration_m_s2, jerk_time_s
    # The largest v that leaves d / v - v / a >= Tj; written without the difference of near equals.
    reachable = 2 * distance / (ramp + sqrt(ramp**2 + 4 * distance / a))
    velocity = min(max_velocity_m_s, reachable)
    pulse = velocity / a
    short, long = min(pulse, ramp), max(pulse, ramp)
    coast = max(distance / velocity - pulse - ramp, 0.0)
    jerk = np.copysign(a / ramp, end_m - start_m)
    durations = [short, long - short, short, coast, short, long - short, short]
    signs = np.array([1, 0, -1, 0, -1, 0, 1])
    return jerk_segments(start_m, end_m, durations, jerk * signs)


class BackAndForth(OneAxisProgram):
    """Forth over `distance_m`, dwell, back, dwell; each half lasts half of `period_s`."""

    kind: Literal["back_and_forth"] = Field(
        default="back_and_forth", description="between two points, with dwells"
    )
    start_m: Coordinate = Field(description="first of the two points")
    distance_m: Coordinate = Field(description="signed: from the first point to the second")
    max_velocity_m_s: Positive = Field(description="speed that is not exceeded")
    max_acceleration_m_s2: Positive = Field(description="acceleration that is not exceeded")
    jerk_time_s: Positive = Field(description="duration of each change of acceleration")
    period_s: Positive = Field(description="there and back, dwells included")
    cycles: Cycles = Field(default=1, description="how many times it is repeated")

    @field_validator("distance_m")
    @classmethod
    def _moves(cls, distance_m: float) -> float:
        if abs(distance_m) < NEGLIGIBLE_M:
            raise ValueError("must not be 0")
        return distance_m

    @field_validator("period_s")
    @classmethod
    def _long_enough(cls, period_s: float, info: ValidationInfo) -> float:
        needed = ("start_m", "distance_m", "max_velocity_m_s", "max_acceleration_m_s2")
        try:
            start, distance, velocity, acceleration = (info.data[key] for key in needed)
            jerk_time = info.data["jerk_time_s"]
        except KeyError:  # told of already
            return period_s
        end = start + distance
        move = smoothed_trapezoid(start, end, velocity, acceleration, jerk_time)
        move_s = float(move["duration_s"].sum())
        if period_s < 2 * move_s:
            enough = ceil(2e6 * move_s) / 1e6
            raise ValueError(
                f"one way takes {move_s:.6f} s, so the period must be at least {enough:.6f} s"
            )
        return period_s

    @field_validator("cycles")
    @classmethod
    def _fits(cls, cycles: int) -> int:
        check_cycles(cycles, SEGMENTS_A_CYCLE)
        return cycles

    def trajectories(self) -> dict[str, Trajectory]:
        """Make all cycles."""
        there = self.start_m + self.distance_m
        limits = self.max_velocity_m_s, self.max_acceleration_m_s2, self.jerk_time_s
        forth = Trajectory(smoothed_trapezoid(self.start_m, there, *limits))
        back = Trajectory(smoothed_trapezoid(there, self.start_m, *limits))
        dwell_s = max(self.period_s / 2 - forth.duration_s, 0.0)
        cycle = forth.hold(dwell_s).then(back).hold(dwell_s)
        return {self.axis: cycle.repeat(self.cycles)}
