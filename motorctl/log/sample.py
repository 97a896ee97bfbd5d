"""The sample: the same fields in the loop, in the shared ring, in the log and in the analysis."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray


class AxisState(IntEnum):
    """States of an axis."""

    OFF = 0
    """Disabled: the motor gives no force."""
    HOMING = 1
    """Looking for its zero."""
    IDLE = 2
    """Enabled and holding its position."""
    RUNNING = 3
    """Following a program or a move."""
    STOPPING = 4
    """On the ramp that brings it to rest."""
    FAULT = 5
    """A guard tripped, or homing failed: disabled until it is reset; `fault` says why."""


class SampleFlag(IntFlag):
    """What happened to an axis in a tick."""

    SATURATED = 1 << 0
    """The command stood at the voltage limit."""
    ADAPTING = 1 << 1
    """The estimator took this tick's data."""
    PROJECTED = 1 << 2
    """The estimate was projected onto its bounds or Assumption 2's half-plane."""
    HOMED = 1 << 3
    """Its zero is known: soft limits are in force."""
    SKIPPED = 1 << 4
    """One or more whole periods were skipped right before this tick (overrun)."""
    LIMIT_NEGATIVE = 1 << 5
    """The limit switch at the negative end was pressed."""
    LIMIT_POSITIVE = 1 << 6
    """The limit switch at the positive end was pressed."""
    HOME_SWITCH = 1 << 7
    """The home switch was pressed."""
    INDEX = 1 << 8
    """An index mark was passed since the tick before."""
    HELD = 1 << 9
    """The driver had no new sample: the position is the last one, or the model's prediction."""
    BETWEEN = 1 << 10
    """No tick of the axis, which has fewer than the loop: the row repeats its last."""
    LEFT_OUT = 1 << 11
    """With HELD: a sample came, but no motion of the axis explains it, so the model stood in."""


def without_sample(flags: NDArray[Any]) -> NDArray[np.bool_]:
    """Return in which rows an axis had no new sample of its device, though it had a tick."""
    own_held: NDArray[np.bool_] = flags & int(SampleFlag.HELD | SampleFlag.BETWEEN) == int(
        SampleFlag.HELD
    )
    return own_held


class FaultCause(IntEnum):
    """Why an axis is in the state FAULT."""

    NONE = 0
    """It is not."""
    FOLLOWING_ERROR = 1
    """It was further from its reference than `limits.following_error` allows."""
    SOFT_LIMIT = 2
    """It left `limits.travel_m`, homed."""
    OVERSPEED = 3
    """It was faster than `limits.max_velocity_m_s` allows."""
    NOT_A_NUMBER = 4
    """The law computed a command that is not finite."""
    ENCODER_LOST = 5
    """The driver reported that the count cannot be trusted."""
    ENCODER_JUMP = 6
    """The count went where no motion leads."""
    AMPLIFIER = 7
    """The driver reported a fault of the amplifier."""
    COMMUNICATION = 8
    """The driver reported that it has lost the device."""
    ESTOP = 9
    """An emergency stop: of a person, or of the hardware's chain."""
    LIMIT_SWITCH = 10
    """It ran onto a limit switch."""
    HOMING_FAILED = 11
    """Homing found no switch or mark, or took too long."""
    OVERRUN = 12
    """Ticks came too late, too often: `loop.overrun_policy`, the guard `late_ticks`."""
    SUPERVISOR_LOST = 13
    """The supervisor process gave no sign of life."""
    NO_NEW_SAMPLE = 14
    """The driver had no new sample for more ticks than the configuration allows."""
    PARTNER = 15
    """Another axis tripped that this one stops together with."""
    ENCODER_STUCK = 16
    """The count stood still while the reference moved."""
    ENCODER_NOISE = 17
    """The count at standstill was noisier than any motion could make it."""
    SATURATION = 18
    """The command stood at the voltage limit for too long."""
    THERMAL = 19
    """The model of the motor's heat exceeded what the motor can carry continuously."""
    SKEW = 20
    """The two ends of a dual drive were too far apart."""
    NOT_SQUARE = 21
    """Homing found the switches or marks of the two ends of a dual drive too far apart."""
    HOST_FROZEN = 22
    """The computer paused for longer than the axis, its device or its counter stands."""

    @property
    def guard(self) -> str:
        """Return which guard it is, as `guards:` of an axis and the documentation name it."""
        return "late_ticks" if self is FaultCause.OVERRUN else self.name.lower()


@dataclass(frozen=True)
class Signal:
    """One field of the sample: in the records, and as a column of the log."""

    name: str
    dtype: str
    unit: str
    """Empty: a count, or a code."""
    description: str
    per_parameter: bool = False
    """One value for each parameter of theta."""
    of_dual_drive: bool = False
    """Only axes with two motors have it; zero in the records of others."""
    of_learning: bool = False
    """Only axes that learn for programs that repeat have it; zero in the records of others."""

    def is_recorded(self, *, dual_drive: bool, learning: bool) -> bool:
        """Return whether an axis has it in its log."""
        return (dual_drive or not self.of_dual_drive) and (learning or not self.of_learning)


TICK_FIELDS = (
    Signal("tick", "i8", "", "number of the period; a gap is a skipped period"),
    Signal("time_s", "f8", "s", "scheduled time since the first tick"),
    Signal("lateness_s", "f8", "s", "wake-up after the scheduled time"),
    Signal("turnaround_s", "f8", "s", "from the wake-up to the end of the write"),
    Signal("read_s", "f8", "s", "of the turnaround: reading"),
    Signal("compute_s", "f8", "s", "of the turnaround: computing"),
    Signal("write_s", "f8", "s", "of the turnaround: writing"),
)
"""What is sampled once a tick. A new field stands here, and is written in `loop.publish`."""

AXIS_FIELDS = (
    Signal("reference_m", "f8", "m", "desired position"),
    Signal("reference_velocity_m_s", "f8", "m/s", "desired velocity"),
    Signal("reference_acceleration_m_s2", "f8", "m/s^2", "desired acceleration"),
    Signal("position_m", "f8", "m", "measured position"),
    Signal("velocity_m_s", "f8", "m/s", "difference of two measured positions"),
    Signal("following_error_m", "f8", "m", "position - reference"),
    Signal("command_v", "f8", "V", "as written to the driver, after every limit"),
    Signal("virtual_command_v", "f8", "V", "v, before the inverse of the input map"),
    Signal("excitation_v", "f8", "V", "injected beside the law's command; command_v has it in it"),
    Signal(
        "learned_v",
        "f8",
        "V",
        "learned for this program, beside the law's command; command_v has it in it",
        of_learning=True,
    ),
    Signal("d0_hat_v", "f8", "V", "fast estimate of the lumped disturbance"),
    Signal("theta_hat", "f8", "", "estimate of a parameter, in its own unit", per_parameter=True),
    Signal("state", "i4", "", "AxisState"),
    Signal("fault", "i4", "", "FaultCause"),
    Signal("flags", "u4", "", "SampleFlag"),
    Signal("device_status", "u4", "", "motorctl.hal.Status, as the driver gave it"),
    Signal("skew_m", "f8", "m", "position of the first end - of the second", of_dual_drive=True),
    Signal("skew_reference_m", "f8", "m", "what the skew is held at", of_dual_drive=True),
    Signal(
        "skew_command_v",
        "f8",
        "V",
        "of the skew loop: command_v + this left for the first motor, - this for the second",
        of_dual_drive=True,
    ),
    Signal(
        "second_device_status",
        "u4",
        "",
        "motorctl.hal.Status of the second end; device_status joins both",
        of_dual_drive=True,
    ),
)
"""What is sampled of each axis in each tick. A new field stands here, and is written in
`loop.axis.axis_step`; the ring, the log's columns and its metadata follow."""


def row_bytes(axes: Iterable[tuple[int, bool, bool]]) -> int:
    """Return what a row takes while it is recorded, without the little that each batch adds.

    Parameters
    ----------
    axes
        Of each axis, how many entries its theta has, whether two motors drive it, and whether it
        learns for programs that repeat.
    """
    size = sum(np.dtype(field.dtype).itemsize for field in TICK_FIELDS)
    for count, two_motors, learning in axes:
        for field in AXIS_FIELDS:
            if not field.is_recorded(dual_drive=two_motors, learning=learning):
                continue
            size += np.dtype(field.dtype).itemsize * (count if field.per_parameter else 1)
    return size


TICK_SAMPLE = np.dtype([(field.name, field.dtype) for field in TICK_FIELDS], align=True)


def axis_sample(parameters: int) -> np.dtype[np.void]:
    """Return the record of one axis in one tick, for a theta of at most `parameters` entries."""
    return np.dtype(
        [
            (field.name, field.dtype, (parameters,) if field.per_parameter else ())
            for field in AXIS_FIELDS
        ],
        align=True,
    )
