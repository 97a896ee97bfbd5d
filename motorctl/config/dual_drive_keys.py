"""The keys of a dual drive: the second motor and encoder of an axis, and the loop of its skew."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from motorctl.config.keys import Keys, NotNegative, Number, Positive

SECOND_END = ".2"
"""What a driver knows the second end of an axis by: the axis' name, then this."""


class SkewLoop(Keys):
    """The loop that holds the two ends together: p = de/dt + k1 e, e the skew's error.

    It adds du = -ks p - d with dd/dt = gamma_d p to the first motor's command, and takes it from
    the second's.
    """

    k1_1_s: Positive = Field(description="k1 of the skew, 1/s")
    ks_v_s_m: Positive = Field(description="ks of the skew, V*s/m")
    gamma_d: NotNegative = Field(
        default=0.0, description="rate at which a lasting difference of the two is learned, V/m"
    )
    max_voltage_v: Positive = Field(
        description="most that it may add to one motor and take from the other; the law has what "
        "is left of limits.max_voltage_v"
    )
    inertia_v_s2_m: Positive = Field(
        description="what resists skew: du = inertia s'' + damping s' + stiffness s; of a beam J / "
        "(A L^2), its rotary inertia by a motor's force a volt and the ends' distance squared"
    )
    damping_v_s_m: NotNegative = Field(default=0.0, description="of the skew, V*s/m")
    stiffness_v_m: NotNegative = Field(
        default=0.0, description="of guideways and joints against skew, V/m"
    )
    squaring_velocity_m_s: Positive = Field(
        default=1e-3, description="speed at which a beam that stands askew is squared"
    )


class DualDrive(Keys):
    """A second motor and a second encoder on the same beam: the axis is the mean of its two ends.

    `channel`, `encoder` and the home switch of the axis are those of the first end. The second
    encoder has the same resolution and width.
    """

    channel: Annotated[int, Field(ge=0, le=1023)] = Field(
        description="which of the device's channels the second end is; of the same driver"
    )
    encoder_direction: Literal[-1, 1] = Field(
        default=1, description="of the second encoder: 1 where its counts grow with the position"
    )
    encoder_offset_m: Number | None = Field(
        default=None, description="position at the second count zero; null: encoder.offset_m"
    )
    motor_direction: Literal[-1, 1] = Field(
        default=1, description="of the second motor: -1 where positive volts push it back"
    )
    skew: SkewLoop = Field(description="the loop that holds the ends together")
    square_offset_m: Number = Field(
        default=0.0,
        description="how far ahead of the second end's home switch or mark that of the first lies, "
        "where the beam is square",
    )
    max_out_of_square_m: Positive | None = Field(
        default=None,
        description="homing is a fault where the ends' switches or marks differ by more, and so is "
        "a start further askew; null, with absolute encoders: guards.skew.limit_m",
    )
