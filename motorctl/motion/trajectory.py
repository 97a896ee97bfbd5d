"""A trajectory: a segment table that is continuous in position, velocity and acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from motorctl.errors import UsageError
from motorctl.motion.extrema import signed_extrema
from motorctl.motion.segments import SEGMENT, Array, Segments, derivatives, rest_segment

# What two neighbours may differ by where they join: far below an encoder count, above rounding.
JOINT_TOLERANCE = (1e-9, 1e-8, 1e-6)
_UNITS = (("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s^2"))


@dataclass(frozen=True)
class Peaks:
    """The exact extremes of a trajectory, and when each occurs (time_s since its start)."""

    range_m: tuple[float, float]
    range_at_s: tuple[float, float]
    max_velocity_m_s: float
    max_velocity_at_s: float
    max_acceleration_m_s2: float
    max_acceleration_at_s: float
    max_jerk_m_s3: float
    max_jerk_at_s: float


class Trajectory:
    """A motion of one axis, jerk-limited because no joint may step in x, v or a."""

    def __init__(self, segments: Segments) -> None:
        """Take a table (N,) of SEGMENT, N >= 1; raises UsageError where it is no such motion."""
        if segments.dtype != SEGMENT or segments.ndim != 1 or len(segments) == 0:
            raise UsageError("a trajectory needs a table of one or more segments")
        self.segments = segments.copy()
        self.segments.setflags(write=False)
        durations, coefficients = self.segments["duration_s"], self.segments["c"]
        if not (np.isfinite(durations).all() and np.isfinite(coefficients).all()):
            raise UsageError("a trajectory's numbers must be finite")
        if (durations < 0).any():
            raise UsageError("a trajectory's segments cannot have negative durations")
        self._ends_s = np.cumsum(durations)
        self._starts_s = np.concatenate([[0.0], self._ends_s[:-1]])
        _check_joints(self.segments, self._ends_s)

    @classmethod
    def at_rest(cls, position_m: float, duration_s: float = 0.0) -> Trajectory:
        """Stand at `position_m` [m] for `duration_s` [s]."""
        return cls(rest_segment(position_m, duration_s))

    @property
    def duration_s(self) -> float:
        """Time from the start to the end."""
        return float(self._ends_s[-1])

    @property
    def start_m(self) -> float:
        """Position at the start."""
        return float(self.segments["c"][0, 0])

    @property
    def end_m(self) -> float:
        """Position at the end."""
        return self._end()[0]

    def sample(self, time_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Return x [m], v [m/s], a [m/s^2] at times of any shape, clamped to [0, duration]."""
        asked = np.asarray(time_s, np.float64)
        t = np.clip(asked.ravel(), 0.0, self.duration_s)
        index = np.minimum(np.searchsorted(self._ends_s, t, side="right"), len(self.segments) - 1)
        durations = self.segments["duration_s"]
        s = np.clip(t - self._starts_s[index], 0.0, durations[index])
        # At the very end the difference of two long times would miss the last segment's end.
        s = np.where(t >= self.duration_s, durations[-1], s)
        x, v, a = derivatives(self.segments["c"][index], s)
        return x.reshape(asked.shape), v.reshape(asked.shape), a.reshape(asked.shape)

    def peaks(self) -> Peaks:
        """Find the range and the largest |v|, |a|, |jerk| from the extrema of every polynomial."""
        segments, starts_s = self.distinct()
        (low, low_at, high, high_at), *rest = signed_extrema(segments, starts_s)
        largest = [max((-low, low_at), (high, high_at)) for low, low_at, high, high_at in rest]
        (v, v_at), (a, a_at), (j, j_at) = largest
        return Peaks((low, high), (low_at, high_at), v, v_at, a, a_at, j, j_at)

    def distinct(self) -> tuple[Segments, Array]:
        """Return each different segment once, and when it first starts [s]."""
        rows = self.segments.view(np.dtype((np.void, SEGMENT.itemsize)))
        first = np.sort(np.unique(rows, return_index=True)[1])
        return self.segments[first], self._starts_s[first]

    def then(self, other: Trajectory) -> Trajectory:
        """Append a motion; raises UsageError unless it starts in the state where this one ends."""
        return Trajectory(np.concatenate([self.segments, other.segments]))

    def hold(self, duration_s: float) -> Trajectory:
        """Append a rest at the end position; raises UsageError unless this motion ends at rest."""
        return self.then(Trajectory.at_rest(self.end_m, duration_s))

    def repeat(self, times: int) -> Trajectory:
        """Follow this motion `times` >= 1 times; raises UsageError unless it ends as it starts."""
        return Trajectory(np.tile(self.segments, times))

    def _end(self) -> tuple[float, float, float]:
        last = self.segments[-1:]
        x, v, a = derivatives(last["c"], last["duration_s"])
        return float(x[0]), float(v[0]), float(a[0])


def _check_joints(segments: Segments, ends_s: Array) -> None:
    """Raise UsageError, with time and sizes, at the worst joint that steps."""
    left = derivatives(segments["c"][:-1], segments["duration_s"][:-1])
    right = segments["c"][1:, 0], segments["c"][1:, 1], 2 * segments["c"][1:, 2]
    for before, after, tolerance, (what, unit) in zip(
        left, right, JOINT_TOLERANCE, _UNITS, strict=True
    ):
        step = np.abs(after - before)
        if len(step) and step.max() > tolerance:
            worst = int(step.argmax())
            raise UsageError(
                f"{what} steps from {before[worst]:.9g} to {after[worst]:.9g} {unit} "
                f"at {ends_s[worst]:.6g} s; a trajectory must be continuous"
            )
