"""How far, fast and hard a motion that is made for an axis may drive it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motorctl.config.analysis import required_command
from motorctl.config.experiment_envelope import allowed_travel_m
from motorctl.config.machine import Axis, Machine
from motorctl.errors import UsageError
from motorctl.identify.diagnose.report.motion_advice import Reach

CLEARANCE = 0.05
"""Part of the travel that is kept free at either end."""
SPEED = 0.9
"""Of what the axis' own programs reach, else of its limit."""
ACCELERATION = 0.85
VOLTAGE = 0.7
"""Of the limit: what motion may need where no program of its own tells what the axis can do."""
ACCELERATION_STEPS = 50


def reach_of(machine: Machine, axis: Axis, effort: float = 1.0) -> Reach:
    """Return how far, fast and hard the axis may be driven.

    No harder than by its own programs, which the machine is known to follow; where it has none in
    which it moves, as hard as a part of its voltage allows.
    """
    limits = axis.limits
    low, high = limits.travel_m
    free = CLEARANCE * (high - low)
    speed, acceleration, jerk = (
        limits.max_velocity_m_s,
        limits.max_acceleration_m_s2,
        limits.max_jerk_m_s3,
    )
    own = [p for p in machine.programs.values() if axis.name in p.axes]
    peaks = [program.trajectories()[axis.name].peaks() for program in own]
    count_m = axis.encoder.resolution_m
    peaks = [peak for peak in peaks if peak.range_m[1] - peak.range_m[0] > count_m]
    if peaks:
        speed = min(speed, max(peak.max_velocity_m_s for peak in peaks))
        acceleration = min(acceleration, max(peak.max_acceleration_m_s2 for peak in peaks))
        jerk = min(jerk, max(peak.max_jerk_m_s3 for peak in peaks))
    else:
        acceleration = _affordable(axis, SPEED * speed, acceleration)
    return Reach(
        low + free,
        high - free,
        SPEED * effort * speed,
        ACCELERATION * effort * acceleration,
        effort * jerk,
        axis.units,
    )


def reach_in_envelope(machine: Machine, axis: Axis, effort: float = 1.0) -> Reach:
    """Return the same, and no more than axes.NAME.experiments allows where that is declared.

    Raises UsageError where its travel leaves nothing of what may be used.
    """
    reach = reach_of(machine, axis, effort)
    own = axis.experiments
    if own is None:
        return reach
    allowed = allowed_travel_m(axis)
    low, high = max(reach.low, allowed[0]), min(reach.high, allowed[1])
    if not low < high:
        words = (
            f"axes.{axis.name}.experiments.travel_m: {allowed[0]:g} to {allowed[1]:g} m leaves "
            f"nothing of the {reach.low:g} to {reach.high:g} m in which motions are made: "
            f"{100 * CLEARANCE:g} % of limits.travel_m are kept free at either end"
        )
        raise UsageError(axis.units.words(words))
    return replace(
        reach,
        low=low,
        high=high,
        speed=min(reach.speed, own.max_velocity_share * axis.limits.max_velocity_m_s),
        acceleration=min(
            reach.acceleration, own.max_acceleration_share * axis.limits.max_acceleration_m_s2
        ),
    )


def _affordable(axis: Axis, speed: float, acceleration: float) -> float:
    """Return the acceleration that a part of the voltage makes at a speed, by the start values."""
    limit = axis.limits.max_voltage_v
    needed = required_command(axis.model, axis.theta_initial, limit)
    a = np.linspace(acceleration / ACCELERATION_STEPS, acceleration, ACCELERATION_STEPS)
    x = np.full_like(a, 0.5 * sum(axis.limits.travel_m))
    enough = np.abs(needed(x, np.full_like(a, speed), a)) <= VOLTAGE * limit
    return float(a[enough].max() if enough.any() else a[0])
