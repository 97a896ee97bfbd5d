"""The keys of one axis, and of the whole file around its axes."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from pydantic import Field

from motorctl.axis_units import AxisKind, AxisUnits, units_of
from motorctl.config.dual_drive_keys import DualDrive
from motorctl.config.guard_keys import Guards
from motorctl.config.keys import (
    AxisName,
    DriverKeys,
    Keys,
    LoopSettings,
    Name,
    NotNegative,
    Number,
    OpenKeys,
    Positive,
    ProgramKeys,
    Range,
    Rate,
)
from motorctl.config.recording_keys import RecordingKeys
from motorctl.motion import AxisLimits

Controller = Literal["C1", "C2"]
HomingMethod = Literal["absolute", "switch", "switch_index", "index"]


class Encoder(Keys):
    """How counts become metres: x = direction * (counts * resolution) + offset."""

    resolution_m: Positive = Field(description="metres a count; of a rotary axis radians")
    counter_bits: Annotated[int, Field(ge=8, le=64)] = Field(
        default=32, description="width at which the device's counter wraps"
    )
    direction: Literal[-1, 1] = Field(
        default=1, description="1 where the position grows with positive volts and counts"
    )
    offset_m: Number = Field(default=0.0, description="position at count zero")


class FollowingErrorLimit(Keys):
    """Trip where |e| > minimum_m + per_velocity_s |reference velocity| for filter_time_s.

    Time within the limit is taken off, so that an axis that swings through its reference trips too,
    where it swings by more than 1.41 times the limit: it is beyond for more than half of the time.
    """

    minimum_m: Positive = Field(description="limit at standstill")
    per_velocity_s: NotNegative = Field(default=0.0, description="growth with the speed")
    filter_time_s: NotNegative = Field(default=0.0, description="how long it may be exceeded")


class StopRamp(Keys):
    """The ramp that stops the axis."""

    acceleration_m_s2: Positive = Field(
        description="deceleration of the ramp, at most max_acceleration_m_s2"
    )
    jerk_m_s3: Positive = Field(description="jerk of the ramp, at most max_jerk_m_s3")


class Limits(Keys):
    """What an axis may never exceed."""

    travel_m: Range = Field(description="soft limits, lower then upper; in force once homed")
    max_velocity_m_s: Positive = Field(description="top speed; 1.2 times as much trips the axis")
    max_acceleration_m_s2: Positive = Field(description="most that a program or a move may ask")
    max_jerk_m_s3: Positive = Field(description="most that a program or a move may ask")
    max_voltage_v: Positive = Field(description="uM: command at which the law saturates")
    max_excitation_share: Annotated[float, Field(ge=0, le=0.5)] = Field(
        default=0.2,
        description="most that an excitation for a frequency response may add to the command, as a "
        "share of max_voltage_v; 0: none is allowed",
    )
    following_error: FollowingErrorLimit = Field(
        description="how far the position may be from the reference, and for how long"
    )
    stop: StopRamp = Field(description="the ramp of `stop`, and of a fault that may still brake")

    @property
    def max_excitation_v(self) -> float:
        """Most that an excitation may add to the command [V]."""
        return self.max_excitation_share * self.max_voltage_v

    def for_motion(self, travel_m: tuple[float, float] | None = None) -> AxisLimits:
        """Return what a program may ask of the axis, or of one with another travel [m]."""
        named = {field.name: getattr(self, field.name) for field in dataclasses.fields(AxisLimits)}
        return AxisLimits(**named | {"travel_m": travel_m or self.travel_m})


class CommandFilterKeys(Keys):
    """A filter on the feedback's part of the command, -ks p - d0, where a resonance limits."""

    kind: Literal["notch", "low_pass"] = Field(
        description="notch: (s^2 + 2 depth damping w s + w^2)/(s^2 + 2 damping w s + w^2); "
        "low_pass: w^2/(s^2 + 2 damping w s + w^2)"
    )
    frequency_hz: Positive = Field(description="w/2pi, below 0.45 times the axis' rate")
    damping: Annotated[float, Field(ge=0.01, le=2)] = Field(
        default=0.7, description="of the poles: how wide the notch is"
    )
    depth: Annotated[float, Field(ge=0.01, le=1)] = Field(
        default=0.1, description="what the notch leaves at its frequency"
    )


class Gains(Keys):
    """Gains of the robust part: p = de/dt + k1 e, vs = -ks p."""

    k1_1_s: Positive = Field(description="k1, 1/s")
    ks_v_s_m: Positive = Field(description="ks = ks1 + ks2, V*s/m")
    gamma_d: NotNegative = Field(description="rate of the fast adaptation of d0, V/m")
    d_hat_max_v: NotNegative = Field(description="bound of d0, V")
    velocity: Literal["matched", "published"] = Field(
        default="matched",
        description="de/dt: matched, the difference of two errors; published, the difference of "
        "two positions minus the desired velocity, which is half a period ahead of it",
    )
    command_filter: CommandFilterKeys | None = Field(
        default=None, description="null: none, the law as published"
    )


class ParameterKeys(Keys):
    """Start value, bounds and initial covariance of one parameter; the effect has defaults."""

    initial: Number | None = Field(default=None, description="theta_hat(0)")
    bounds: Range | None = Field(default=None, description="lower, upper")
    covariance: Positive | None = Field(default=None, description="diagonal of Gamma(0)")


class EffectKeys(ParameterKeys, OpenKeys):
    """One effect: its parameter or parameters, and the effect's own options."""

    type: str | None = Field(default=None, description="package.module:Class of one's own effect")
    parameters: dict[str, ParameterKeys] | None = Field(
        default=None, description="for an effect with several parameters, by their names"
    )


class Adaptation(Keys):
    """How the parameters are learned while running."""

    enabled: bool = Field(default=True, description="learn while running; else theta_hat stays")
    forgetting_1_s: NotNegative = Field(default=0.0, description="alpha")
    normalisation: NotNegative = Field(default=0.0, description="nu")
    filter_rad_s: Positive = Field(default=200.0, description="both poles of Hf")
    covariance_limit: Annotated[float, Field(ge=1, le=1e9)] = Field(
        default=10.0, description="forgetting stops beyond this many times Gamma(0)"
    )
    rate_limit_1_s: Positive | None = Field(
        default=None, description="bound on |d theta/dt| / sqrt(Gamma(0)); null: none"
    )
    gate_velocity_m_s: NotNegative = Field(default=0.02, description="learn above this speed")
    gate_acceleration_m_s2: NotNegative = Field(default=1.0, description="or this acceleration")
    input_delay_s: NotNegative = Field(
        default=0.0, description="known delay from the command to the force"
    )
    monotonicity_margin: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.05, description="Assumption 2: smallest dv/du that the estimate may have"
    )
    keep_learned: bool = Field(
        default=False,
        description="save the estimate at stop, and go on from it at the daemon's next start",
    )


class Homing(Keys):
    """How the axis finds its zero."""

    method: HomingMethod = Field(
        description="absolute: the encoder knows its position at power-on; else what is searched: "
        "the home switch's edge, the next index mark after it, or the next index mark"
    )
    search_velocity_m_s: Number | None = Field(
        default=None, description="signed: towards the switch"
    )
    latch_velocity_m_s: Number | None = Field(
        default=None, description="signed: at which the edge or the index mark is latched"
    )
    home_position_m: Number | None = Field(
        default=None, description="position of the edge or of the index mark"
    )
    timeout_s: Positive | None = Field(
        default=None, description="homing that takes longer is a fault"
    )


class Experiments(Keys):
    """What of an axis an experiment may use without a person's yes."""

    travel_m: Range | None = Field(
        default=None, description="within which it stays; null: the middle half of limits.travel_m"
    )
    max_velocity_share: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.5, description="most that it asks, as a share of limits.max_velocity_m_s"
    )
    max_acceleration_share: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.5, description="most that it asks, as a share of limits.max_acceleration_m_s2"
    )
    max_minutes: Annotated[float, Field(gt=0, le=1440)] = Field(
        default=10.0, description="of motion in one session"
    )


class Learning(Keys):
    """What is learned for programs that repeat."""

    file: Annotated[str, Field(min_length=1)] = Field(
        description="JSON file of what `motorctl learn` has learned, seen from the folder of the "
        "configuration; it need not be there yet"
    )
    max_share: Annotated[float, Field(gt=0, le=0.3)] = Field(
        default=0.1,
        description="most that it may add to the command, as a share of limits.max_voltage_v",
    )


class AxisSettings(Keys):
    """Everything that an axis' keys say but its list of effects."""

    kind: AxisKind = Field(
        default="linear",
        description="linear: positions are in metres; rotary: in radians, and so is every key and "
        "column of the axis that is named in metres: resolution_m: radians a count, "
        "max_velocity_m_s: rad/s",
    )
    driver: str = Field(description="name of the driver that serves the axis")
    channel: Annotated[int, Field(ge=0, le=1023)] = Field(
        description="which of the device's channels it is, from 0"
    )
    dual_drive: DualDrive | None = Field(
        default=None, description="a second motor and encoder on the same beam; null: one drive"
    )
    controller: Controller = Field(
        default="C2", description="C1: without the electromagnetic effects; C2: with them"
    )
    encoder: Encoder = Field(description="how counts become metres")
    limits: Limits = Field(description="what the axis may never exceed")
    guards: Guards = Field(
        default_factory=Guards, description="what trips the axis beside its limits"
    )
    gains: Gains = Field(description="gains of the robust part")
    adaptation: Adaptation = Field(
        default_factory=Adaptation, description="how the parameters are learned while running"
    )
    homing: Homing = Field(description="how the axis finds its zero")
    program: str | None = Field(default=None, description="followed after start; null: hold")
    experiments: Experiments | None = Field(
        default=None,
        description="what experiments may do where nobody is asked (--yes); null: nothing",
    )
    learning: Learning | None = Field(
        default=None, description="a feedforward learned by repeating the program; null: none"
    )

    @property
    def units(self) -> AxisUnits:
        """Units of what is said of the axis."""
        return units_of(self.kind)

    @property
    def max_learned_v(self) -> float:
        """Most that what was learned may add to the command [V]; 0 where nothing may."""
        return 0.0 if self.learning is None else self.learning.max_share * self.limits.max_voltage_v


class AxisKeys(AxisSettings):
    """One axis."""

    model: dict[str, EffectKeys] = Field(min_length=1, description="effects, in order of theta")


class ConfigurationKeys(Keys):
    """A machine."""

    name: Name = Field(description="what the machine is called, in logs and messages")
    rate_hz: Rate = Field(description="ticks a second")
    drivers: dict[Name, DriverKeys] = Field(min_length=1, description="the devices, by name")
    axes: dict[AxisName, AxisKeys] = Field(min_length=1, description="the axes, by name")
    programs: dict[Name, ProgramKeys] = Field(
        default_factory=dict, description="motions that axes can follow, by name"
    )
    further_effects: dict[Name, str] = Field(
        default_factory=dict,
        description="effects of one's own that diagnose tries beside the known ones: by name, "
        "package.module:Class",
    )
    stop_together: list[list[AxisName]] | None = Field(
        default=None,
        description="groups of axes: when one of a group trips, the others are ramped down; null: "
        "the axes of one running program are such a group; []: every axis is by itself",
    )
    recording: RecordingKeys = Field(default_factory=RecordingKeys, description="where logs go")
    loop: LoopSettings = Field(
        default_factory=LoopSettings, description="how the loop asks for real time"
    )
