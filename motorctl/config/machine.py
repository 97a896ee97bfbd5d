"""The machine description: what a checked configuration becomes, frozen."""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from motorctl.hal import Driver, DriverOptions
from motorctl.model import EffectList
from motorctl.motion import Program

Controller = Literal["C1", "C2"]
OverrunPolicy = Literal["count", "leaky_bucket", "stop"]
HomingMethod = Literal["absolute", "switch", "switch_index", "index"]


@dataclass(frozen=True)
class Encoder:
    """How counts become metres: x = direction * (counts * resolution) + offset."""

    resolution_m: float
    counter_bits: int
    direction: Literal[-1, 1]
    offset_m: float


@dataclass(frozen=True)
class FollowingErrorLimit:
    """Trip where |e| > minimum_m + per_velocity_s |reference velocity| for filter_time_s."""

    minimum_m: float
    per_velocity_s: float
    filter_time_s: float


@dataclass(frozen=True)
class Limits:
    """What an axis may never exceed."""

    travel_m: tuple[float, float]
    """Soft limits, in force once the axis is homed."""
    max_velocity_m_s: float
    max_acceleration_m_s2: float
    max_jerk_m_s3: float
    max_voltage_v: float
    following_error: FollowingErrorLimit
    stop_acceleration_m_s2: float
    stop_jerk_m_s3: float


@dataclass(frozen=True)
class Gains:
    """Gains of the robust part (p = de/dt + k1 e, vs = -ks p)."""

    k1_1_s: float
    ks_v_s_m: float
    gamma_d: float
    d_hat_max_v: float


@dataclass(frozen=True)
class Estimate:
    """Start value, bounds and initial covariance of one parameter."""

    initial: float
    lower: float
    upper: float
    covariance: float


@dataclass(frozen=True)
class Adaptation:
    """How the parameters are learned while running."""

    enabled: bool
    forgetting_1_s: float
    normalisation: float
    filter_rad_s: float
    covariance_limit: float
    """Forgetting stops where a diagonal of Gamma exceeds this many times its initial value."""
    rate_limit_1_s: float
    """Bound on |d theta_i/dt| / sqrt(Gamma_ii(0))."""
    gate_velocity_m_s: float
    gate_acceleration_m_s2: float
    input_delay_s: float
    monotonicity_margin: float
    """Assumption 2: dv/du stays at or above this over the whole voltage range."""
    keep_learned: bool
    """Save the estimate at stop and take it up at the next start of the daemon."""


@dataclass(frozen=True)
class Homing:
    """How the axis finds its zero."""

    method: HomingMethod
    """absolute: the encoder knows its position at power-on, the axis counts as homed."""
    search_velocity_m_s: float
    """Signed: the direction in which the switch is searched."""
    latch_velocity_m_s: float
    """Signed: the direction in which the switch's edge or the index mark is latched."""
    home_position_m: float
    """Position of the switch's edge or of the index mark in machine coordinates."""
    timeout_s: float


@dataclass(frozen=True)
class Axis:
    """One axis: everything that the loop needs to know of it."""

    name: str
    driver: str
    channel: int
    controller: Controller
    encoder: Encoder
    limits: Limits
    gains: Gains
    declared: EffectList
    """The list as the configuration declares it; the axis runs `model`."""
    model: EffectList
    """`declared` under C2; under C1 without its electromagnetic effects."""
    estimates: tuple[Estimate, ...]
    """One for each parameter of `model`, in its order."""
    adaptation: Adaptation
    homing: Homing
    program: str | None
    """Name of the program that the axis follows after `start`; None: hold."""
    divisor: int = 1
    """Ticks of the loop in one of the axis: the same for all axes of a driver."""


@dataclass(frozen=True)
class DriverSetup:
    """A driver and its options; the axes name it."""

    name: str
    type: str
    cls: builtins.type[Driver]
    options: DriverOptions
    hold_ticks: int = 3
    """So many of its ticks may find no new sample before its axes trip."""
    predict: bool = False
    """Whether the model moves the position on meanwhile."""


@dataclass(frozen=True)
class LoopSettings:
    """How the loop process asks for real time, and what happens where it is not given."""

    cpu: int | None
    priority: int
    spin_s: float
    without_realtime: Literal["degrade", "refuse"]
    overrun_policy: OverrunPolicy
    bucket_size: int


@dataclass(frozen=True)
class Machine:
    """A whole, checked machine."""

    name: str
    source: Path
    rate_hz: float
    drivers: Mapping[str, DriverSetup]
    axes: Mapping[str, Axis]
    programs: Mapping[str, Program]
    loop: LoopSettings
    log_directory: Path
    resolved: Mapping[str, object]
    """The configuration with every default filled in, JSON-serialisable, for log metadata."""

    @property
    def period_s(self) -> float:
        """Ts."""
        return 1.0 / self.rate_hz

    def period_of(self, axis: str) -> float:
        """Give the period of an axis [s]: the loop's, or a whole multiple."""
        return self.period_s * self.axes[axis].divisor

    @property
    def most_parameters(self) -> int:
        """Length of the longest theta: records in shared memory are made for it."""
        return max(len(axis.model) for axis in self.axes.values())

    @property
    def followed_programs(self) -> list[str]:
        """Names of the programs that axes follow after `start`, each once."""
        names = [axis.program for axis in self.axes.values() if axis.program]
        return list(dict.fromkeys(names))
