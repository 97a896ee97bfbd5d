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
    squaring_m_s: float = 0.0
    """How fast a beam with two motors is led to square; 0: there is one motor."""

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
class Beam:
    """A beam with a motor at each end: the broken end, its own, and the other one.

    With the two ends' places as coordinates it has a mass matrix; forces in volts of command.
    """

    own: float
    cross: float
    other: float
    """The mass matrix: [own, cross; cross, other]."""
    own_end: Plant
    other_end: Plant
    own_ratio: float
    other_ratio: float
    """Of each motor's force constant to the one that forces are counted in."""
    stiffness: float
    damping: float
    """Against skew: a force at either end, of the skew and of its rate."""
    limit_m: float
    """How far the ends may be apart from how they are held."""
    full_v: float
    """Of each motor."""
    skew_v: float
    """What the skew loop may take of it, in either direction."""
    to_switch_m: float
    """How far the other end has to go to its home switch, where a search begins."""
    apart_m: float
    """How far an axis goes on while one end's switch has closed and the other's has not."""

    @property
    def determinant(self) -> float:
        """Of the mass matrix."""
        return self.own * self.other - self.cross**2

    def own_m_s2(self, own_v: float, other_v: float) -> float:
        """Return the broken end's acceleration under a force at each end."""
        return (self.other * own_v - self.cross * other_v) / self.determinant

    def other_m_s2(self, own_v: float, other_v: float) -> float:
        """Return the other end's acceleration under a force at each end."""
        return (self.own * other_v - self.cross * own_v) / self.determinant


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
    beam: Beam | None = None
    """Of an axis with two motors, of which one end breaks."""
