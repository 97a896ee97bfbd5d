"""A circle over two axes, from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi, sqrt
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from motorctl.errors import UsageError
from motorctl.motion.move import move_segments
from motorctl.motion.program import Coordinate, Positive, ProgramModel
from motorctl.motion.segments import MOST_SEGMENTS, Array, Segments, derivatives, hermite_segments
from motorctl.motion.trajectory import Trajectory

# How far a piece may be from the true circle, on either axis.
PIECE_ERROR_M = 1e-11


class Circle(ProgramModel):
    """`turns` turns (negative: clockwise) about `center_m`, of the first axis towards the second.

    The limits hold for the vectors of acceleration and jerk, centripetal parts included.
    """

    kind: Literal["circle"] = Field(
        default="circle", description="turns about a centre, of two axes"
    )
    axes: tuple[str, str] = Field(
        description="names of the two axes; the angle counts from the first towards the second"
    )
    center_m: tuple[Coordinate, Coordinate] = Field(description="of each axis")
    radius_m: Positive = Field(description="of the circle")
    speed_m_s: Positive = Field(description="along the circle")
    max_acceleration_m_s2: Positive = Field(description="acceleration that is not exceeded")
    max_jerk_m_s3: Positive = Field(description="jerk that is not exceeded")
    turns: Annotated[float, Field(ge=-1000, le=1000)] = Field(
        default=1.0, description="how many; negative: clockwise"
    )
    start_angle_rad: Coordinate = Field(default=0.0, description="where on the circle it begins")

    @property
    def cycles(self) -> int:
        """Once; `turns` counts the rounds."""
        return 1

    @property
    def period_s(self) -> None:
        """Not repeated from rest to rest."""

    @field_validator("axes")
    @classmethod
    def _distinct(cls, axes: tuple[str, str]) -> tuple[str, str]:
        if axes[0] == axes[1]:
            raise ValueError("must name two different axes")
        return axes

    @field_validator("max_acceleration_m_s2")
    @classmethod
    def _holds_the_circle(cls, limit: float, info: ValidationInfo) -> float:
        if (needed := _steady(info, 2)) is not None and needed >= limit:
            fastest = sqrt(limit * info.data["radius_m"])
            raise ValueError(
                f"the circle alone needs {needed:.6g} m/s^2; "
                f"use more, or a speed_m_s below {fastest:.6g}"
            )
        return limit

    @field_validator("max_jerk_m_s3")
    @classmethod
    def _turns_the_acceleration(cls, limit: float, info: ValidationInfo) -> float:
        if (needed := _steady(info, 3)) is not None and needed >= limit:
            fastest = (limit * info.data["radius_m"] ** 2) ** (1 / 3)
            raise ValueError(
                f"the circle alone needs {needed:.6g} m/s^3; "
                f"use more, or a speed_m_s below {fastest:.6g}"
            )
        return limit

    @field_validator("turns")
    @classmethod
    def _moves(cls, turns: float) -> float:
        if abs(turns) < 1e-6:
            raise ValueError("must not be 0")
        return turns

    def trajectories(self) -> dict[str, Trajectory]:
        """Approximate the circle by quintic pieces that share its x, v and a where they join.

        Raises UsageError where there are too many of them.
        """
        acceleration, jerk = _tangential_limits(
            self.radius_m, self.speed_m_s, self.max_acceleration_m_s2, self.max_jerk_m_s3
        )
        length = 2 * pi * self.radius_m * abs(self.turns)
        path = move_segments(0.0, length, self.speed_m_s, acceleration, jerk)
        states = _angle_states(path, self.radius_m)
        if len(states.duration_s) > MOST_SEGMENTS:
            raise UsageError(
                f"program '{self.name}': {self.turns:g} turns on a radius of {self.radius_m:g} m "
                f"need more than {MOST_SEGMENTS} segments, the limit of a program; use fewer turns"
            )
        direction = np.sign(self.turns)
        angle = self.start_angle_rad + direction * states.angle
        rate, change = direction * states.rate, states.change * direction
        cosine, sine = self.radius_m * np.cos(angle), self.radius_m * np.sin(angle)
        first = hermite_segments(
            states.duration_s,
            self.center_m[0] + cosine,
            -sine * rate,
            -cosine * rate**2 - sine * change,
        )
        second = hermite_segments(
            states.duration_s,
            self.center_m[1] + sine,
            cosine * rate,
            -sine * rate**2 + cosine * change,
        )
        return {self.axes[0]: Trajectory(first), self.axes[1]: Trajectory(second)}


@dataclass(frozen=True)
class _AngleStates:
    """The pieces' durations (N,), angle and its derivatives where they join, all (N + 1,)."""

    duration_s: Array
    angle: Array
    rate: Array
    change: Array


def _steady(info: ValidationInfo, order: int) -> float | None:
    """Return the acceleration (order 2) or jerk (3) of the steady circle, v^n / r^(n - 1)."""
    if "speed_m_s" not in info.data or "radius_m" not in info.data:
        return None  # told of already
    return float(info.data["speed_m_s"] ** order / info.data["radius_m"] ** (order - 1))


def _tangential_limits(
    radius_m: float, speed_m_s: float, acceleration: float, jerk: float
) -> tuple[float, float]:
    """Return what the limits leave for the path's own acceleration and jerk.

    With the path s(t) on radius r, acceleration has the parts s'' along and s'^2/r towards the
    centre; jerk has s''' - s'^3/r^2 along and 3 s' s''/r towards the centre. All are taken at their
    largest at once; the second part of the jerk gets at most half of what the steady circle leaves.
    """
    left_m_s2 = sqrt(acceleration**2 - (speed_m_s**2 / radius_m) ** 2)
    steady_m_s3 = speed_m_s**3 / radius_m**2
    inward_m_s3 = min(3 * speed_m_s * left_m_s2 / radius_m, sqrt(jerk**2 - steady_m_s3**2) / 2)
    along_m_s3 = sqrt(jerk**2 - inward_m_s3**2) - steady_m_s3
    return inward_m_s3 * radius_m / (3 * speed_m_s), along_m_s3


def _angle_states(path: Segments, radius_m: float) -> _AngleStates:
    """Divide the phases of the path (constant jerk) finely enough for `PIECE_ERROR_M`.

    A quintic Hermite piece of duration h is off by at most h^6 / 46080 times the sixth
    derivative of r cos(angle). The angle is a cubic in time, so by Faa di Bruno's formula that
    derivative is bounded by r times the complete Bell polynomial B6 of the bounds on the angle's
    three derivatives.
    """
    durations, rows = [], []
    for segment in path:
        duration, c = float(segment["duration_s"]), segment["c"][None, :] / radius_m
        ends = np.array([0.0, duration])
        _, rate, change = derivatives(np.repeat(c, 2, axis=0), ends)
        w1, w2, w3 = np.abs(rate).max(), np.abs(change).max(), 6 * abs(c[0, 3])
        bell = (
            w1**6
            + 15 * w1**4 * w2
            + 20 * w1**3 * w3
            + 45 * w1**2 * w2**2
            + 60 * w1 * w2 * w3
            + 15 * w2**3
            + 10 * w3**2
        )
        pieces = max(ceil(duration * (radius_m * bell / (46080 * PIECE_ERROR_M)) ** (1 / 6)), 1)
        pieces = min(pieces, MOST_SEGMENTS)  # the caller refuses more
        s = np.linspace(0.0, duration, pieces + 1)
        state = np.stack(derivatives(np.repeat(c, pieces + 1, axis=0), s))
        durations.append(np.full(pieces, duration / pieces))
        rows.append(state[:, :-1])
    last = np.array([[path["c"][-1] @ path["duration_s"][-1] ** np.arange(6) / radius_m], [0], [0]])
    angle, rate, change = np.hstack([*rows, last])
    return _AngleStates(np.concatenate(durations), angle, rate, change)
