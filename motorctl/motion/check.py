"""Check a program against its axes' limits before anything moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from motorctl.errors import UsageError
from motorctl.motion.program import Program
from motorctl.motion.segments import Array, derivatives
from motorctl.motion.trajectory import Trajectory

RequiredVoltage = Callable[[Array, Array, Array], Array]
"""(x [m], v [m/s], a [m/s^2]), all (N,) -> the command that an axis needs there [V], (N,)."""

# A program planned right at a limit passes; both far below what could matter on a machine.
RELATIVE_TOLERANCE = 1e-6
TRAVEL_TOLERANCE_M = 1e-9

VOLTAGE_STEP_S = 1e-3
MOST_VOLTAGE_POINTS = 2000
_BLOCK = 256


@dataclass(frozen=True)
class AxisLimits:
    """What a program may ask of an axis."""

    travel_m: tuple[float, float]
    max_velocity_m_s: float
    max_acceleration_m_s2: float
    max_jerk_m_s3: float
    max_voltage_v: float


@dataclass(frozen=True)
class Violation:
    """A limit that a program exceeds: by how much at worst, and when since its start."""

    axis: str
    quantity: str
    value: float
    limit: float
    unit: str
    time_s: float

    def __str__(self) -> str:
        return (
            f"axis {self.axis}: {self.quantity} {self.value:.6g} {self.unit} at "
            f"{self.time_s:.6g} s exceeds the limit {self.limit:.6g} {self.unit}"
        )


def check_program(
    program: Program,
    limits: Mapping[str, AxisLimits],
    required_voltage: Mapping[str, RequiredVoltage] | None = None,
) -> list[Violation]:
    """List every limit that a program exceeds on any of its axes.

    Position, velocity, acceleration and jerk are compared by their exact extremes. The voltage is
    sampled along the motion, every `VOLTAGE_STEP_S`.

    Parameters
    ----------
    program
        What to check.
    limits
        The limits of each axis, by name.
    required_voltage
        Of the axes whose voltage is checked: the voltage that a motion needs [V].

    Returns
    -------
    list
        Empty where the program may run.

    Raises
    ------
    UsageError
        Where the program moves an axis without limits.
    """
    if unknown := [axis for axis in program.axes if axis not in limits]:
        raise UsageError(
            f"program '{program.name}' moves unknown axes: {', '.join(unknown)}; "
            f"known: {', '.join(sorted(limits)) or 'none'}"
        )
    found: list[Violation] = []
    for axis, trajectory in program.trajectories().items():
        found += _motion_violations(axis, trajectory, limits[axis])
        if required_voltage and axis in required_voltage:
            found += _voltage_violations(
                axis, trajectory, limits[axis].max_voltage_v, required_voltage[axis]
            )
    return found


def _motion_violations(
    axis: str, trajectory: Trajectory, limits: AxisLimits
) -> Iterator[Violation]:
    peaks = trajectory.peaks()
    low, high = limits.travel_m
    if peaks.range_m[0] < low - TRAVEL_TOLERANCE_M:
        yield Violation(axis, "position", peaks.range_m[0], low, "m", peaks.range_at_s[0])
    if peaks.range_m[1] > high + TRAVEL_TOLERANCE_M:
        yield Violation(axis, "position", peaks.range_m[1], high, "m", peaks.range_at_s[1])
    v, a, j = peaks.max_velocity_m_s, peaks.max_acceleration_m_s2, peaks.max_jerk_m_s3
    for quantity, value, limit, unit, time_s in (
        ("velocity", v, limits.max_velocity_m_s, "m/s", peaks.max_velocity_at_s),
        ("acceleration", a, limits.max_acceleration_m_s2, "m/s^2", peaks.max_acceleration_at_s),
        ("jerk", j, limits.max_jerk_m_s3, "m/s^3", peaks.max_jerk_at_s),
    ):
        if value > limit * (1 + RELATIVE_TOLERANCE):
            yield Violation(axis, quantity, value, limit, unit, time_s)


def _voltage_violations(
    axis: str, trajectory: Trajectory, limit: float, required_voltage: RequiredVoltage
) -> Iterator[Violation]:
    value, time_s = 0.0, 0.0
    for times, x, v, a in _samples(trajectory):
        voltage = np.abs(required_voltage(x, v, a))
        # A model that cannot be evaluated somewhere must not pass as harmless.
        voltage = np.where(np.isnan(voltage), np.inf, voltage)
        worst = int(voltage.argmax())
        if voltage[worst] > value:
            value, time_s = float(voltage[worst]), float(times[worst])
    if value > limit * (1 + RELATIVE_TOLERANCE):
        yield Violation(axis, "voltage", value, limit, "V", time_s)


def _samples(trajectory: Trajectory) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Sample blocks of segments, ends included, so that long tables need little memory."""
    segments, starts = trajectory.distinct()
    # A block is sampled as its longest segment needs: put like beside like.
    order = np.argsort(segments["duration_s"])
    segments, starts = segments[order], starts[order]
    for first in range(0, len(segments), _BLOCK):
        block = segments[first : first + _BLOCK]
        longest = float(block["duration_s"].max())
        points = int(np.clip(longest / VOLTAGE_STEP_S, 8, MOST_VOLTAGE_POINTS)) + 1
        s = block["duration_s"][:, None] * np.linspace(0.0, 1.0, points)
        times = starts[first : first + _BLOCK, None] + s
        x, v, a = derivatives(block["c"], s)
        yield times.ravel(), x.ravel(), v.ravel(), a.ravel()
