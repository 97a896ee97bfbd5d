"""The shape of a configuration file, as pydantic models; their descriptions go into the schema.

The shape knows names, types and what a single number may be. What several numbers must be to
each other stands in `rules`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from motorctl.config.machine import Controller, HomingMethod, OverrunPolicy

AxisName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=32)]
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]*$", max_length=64)]
# No machine has numbers beyond these; within them the rules' arithmetic cannot overflow.
SMALLEST = 1e-12
Number = Annotated[float, Field(ge=-1e9, le=1e9)]
Positive = Annotated[float, Field(ge=SMALLEST, le=1e9)]
NotNegative = Annotated[float, Field(ge=0, le=1e9)]
Rate = Annotated[float, Field(gt=0, le=1e5)]
Range = tuple[Number, Number]


class Shape(BaseModel):
    """Base: unknown keys are errors, text is no number, every number is finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class OpenShape(Shape):
    """A part whose further keys belong to a driver or an effect."""

    model_config = ConfigDict(extra="allow")


class LateShape(Shape):
    """What happens where a tick finds no new sample of the device."""

    hold_ticks: Annotated[int, Field(ge=0, le=100_000)] = Field(
        default=3, description="so many of its ticks pass before its axes trip"
    )
    predict: bool = Field(
        default=False,
        description="meanwhile the model moves the position on, and one sample that no motion "
        "explains is left out; else position and command are held",
    )


class DriverShape(OpenShape):
    """A device; every key but these is an option of its driver."""

    type: str = Field(description="name of an installed driver, or package.module:Class")
    rate_hz: Rate | None = Field(
        default=None,
        description="exchanges a second, and ticks of its axes: the loop's rate or a whole part",
    )
    late: LateShape = Field(default_factory=LateShape)


class EncoderShape(Shape):
    """How counts become metres."""

    resolution_m: Positive = Field(description="metres a count")
    counter_bits: Annotated[int, Field(ge=8, le=64)] = Field(
        default=32, description="width at which the device's counter wraps"
    )
    direction: Literal[-1, 1] = Field(
        default=1, description="1 where the position grows with positive volts and counts"
    )
    offset_m: Number = Field(default=0.0, description="position at count zero")


class FollowingErrorShape(Shape):
    """Trip where |e| > minimum_m + per_velocity_s |reference velocity| for filter_time_s."""

    minimum_m: Positive = Field(description="limit at standstill")
    per_velocity_s: NotNegative = Field(default=0.0, description="growth with the speed")
    filter_time_s: NotNegative = Field(default=0.0, description="how long it may be exceeded")


class StopShape(Shape):
    """The ramp that stops the axis."""

    acceleration_m_s2: Positive
    jerk_m_s3: Positive


class LimitsShape(Shape):
    """What an axis may never exceed."""

    travel_m: Range = Field(description="soft limits, lower then upper; in force once homed")
    max_velocity_m_s: Positive
    max_acceleration_m_s2: Positive
    max_jerk_m_s3: Positive
    max_voltage_v: Positive = Field(description="uM: command at which the law saturates")
    following_error: FollowingErrorShape
    stop: StopShape


class GainsShape(Shape):
    """Gains of the robust part: p = de/dt + k1 e, vs = -ks p."""

    k1_1_s: Positive = Field(description="k1, 1/s")
    ks_v_s_m: Positive = Field(description="ks = ks1 + ks2, V*s/m")
    gamma_d: NotNegative = Field(description="rate of the fast adaptation of d0, V/m")
    d_hat_max_v: NotNegative = Field(description="bound of d0, V")


class ParameterShape(Shape):
    """Start value, bounds and initial covariance of one parameter; the effect has defaults."""

    initial: Number | None = Field(default=None, description="theta_hat(0)")
    bounds: Range | None = Field(default=None, description="lower, upper")
    covariance: Positive | None = Field(default=None, description="diagonal of Gamma(0)")


class EffectShape(OpenShape):
    """One effect: its parameter or parameters, and the effect's own options."""

    type: str | None = Field(default=None, description="package.module:Class of one's own effect")
    initial: Number | None = Field(default=None, description="theta_hat(0)")
    bounds: Range | None = Field(default=None, description="lower, upper")
    covariance: Positive | None = Field(default=None, description="diagonal of Gamma(0)")
    parameters: dict[str, ParameterShape] | None = Field(
        default=None, description="for an effect with several parameters, by their names"
    )


class AdaptationShape(Shape):
    """How the parameters are learned while running."""

    enabled: bool = True
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
    keep_learned: bool = Field(default=False, description="go on from the last estimate")


class HomingShape(Shape):
    """How the axis finds its zero."""

    method: HomingMethod
    search_velocity_m_s: Number | None = Field(
        default=None, description="signed: towards the switch"
    )
    latch_velocity_m_s: Number | None = Field(
        default=None, description="signed: at which the edge or the index mark is latched"
    )
    home_position_m: Number | None = Field(
        default=None, description="position of the edge or of the index mark"
    )
    timeout_s: Positive | None = None


class AxisShape(Shape):
    """One axis."""

    driver: str
    channel: Annotated[int, Field(ge=0, le=1023)]
    controller: Controller = Field(
        default="C2", description="C1: without the electromagnetic effects; C2: with them"
    )
    encoder: EncoderShape
    limits: LimitsShape
    gains: GainsShape
    model: dict[str, EffectShape] = Field(min_length=1, description="effects, in order of theta")
    adaptation: AdaptationShape = Field(default_factory=AdaptationShape)
    homing: HomingShape
    program: str | None = Field(default=None, description="followed after start; null: hold")


class ProgramShape(OpenShape):
    """A motion; the further keys depend on its kind."""

    kind: str


class RecordingShape(Shape):
    """Where logs go."""

    directory: Path = Field(
        default=Path("logs"), description="relative to the directory that motorctl is started in"
    )


class LoopShape(Shape):
    """How the loop process asks for real time."""

    cpu: Annotated[int, Field(ge=0, le=4095)] | None = Field(
        default=None, description="null: the highest isolated CPU, if there is one"
    )
    priority: Annotated[int, Field(ge=1, le=99)] = Field(default=80, description="SCHED_FIFO")
    spin_s: Annotated[float, Field(ge=0, le=0.01)] = Field(
        default=60e-6, description="the last part of a wait, spent awake"
    )
    without_realtime: Literal["degrade", "refuse"] = "degrade"
    overrun_policy: OverrunPolicy = "count"
    bucket_size: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=10, description="overruns in a leaky bucket that stop the machine"
    )


class ConfigShape(Shape):
    """A machine."""

    name: Name
    rate_hz: Rate = Field(description="ticks a second")
    drivers: dict[Name, DriverShape] = Field(min_length=1)
    axes: dict[AxisName, AxisShape] = Field(min_length=1)
    programs: dict[Name, ProgramShape] = Field(default_factory=dict)
    recording: RecordingShape = Field(default_factory=RecordingShape)
    loop: LoopShape = Field(default_factory=LoopShape)


def options_of(part: OpenShape) -> dict[str, Any]:
    """Give the keys that belong to the driver, the effect or the kind of program."""
    return dict(part.model_extra or {})
