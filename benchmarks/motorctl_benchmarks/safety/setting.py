"""The numbers of a case that its expectation is computed from: limits, plant, motion, fault."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Limits:
    """What the configuration says of an axis."""

    period_s: float
    count_m: float
    counter_bits: int
    top_speed_m_s: float
    error_minimum_m: float
    error_per_velocity_s: float
    error_filter_s: float
    hold_ticks: int
    predicts: bool
    """The model stands in for samples that do not come, and may doubt one."""
    travel_m: tuple[float, float]
    full_v: float
    k1_1_s: float
    ks_v_s_m: float
    stop_acceleration_m_s2: float
    stop_jerk_m_s3: float

    def ticks(self, time_s: float) -> float:
        """Return a time in ticks."""
        return time_s / self.period_s


@dataclass(frozen=True)
class Plant:
    """What the simulated gantry's options say of the axis; forces in volts of command."""

    inertia: float
    coulomb: float
    viscous: float
    offset: float
    quadratic: float
    cubic: float

    @property
    def full_thrust_v(self) -> float:
        """The force of 10 V: the motor saturates."""
        return 10.0 + self.quadratic * 100.0 + self.cubic * 1000.0

    def friction_v(self, speed_m_s: float) -> float:
        """Return the force that brakes at a speed."""
        return self.coulomb + self.viscous * abs(speed_m_s)


@dataclass(frozen=True)
class Setting:
    """One case, as far as an expectation depends on it."""

    fault: str
    state: str
    limits: Limits
    plant: Plant
    direction: int
    """Of the motion that the axis is ordered to do."""
    speed_m_s: float
    """Of the reference when the fault begins."""
    reference: Callable[[int], float]
    """Where the reference is, so many ticks after the fault's begin [m]."""
    drawn: Mapping[str, float] = field(default_factory=dict)
    """Amounts of the fault, drawn by the case's seed."""
