"""The sample: the same fields in the loop, in the shared ring, in the log and in the analysis."""

from __future__ import annotations

from enum import IntEnum, IntFlag

import numpy as np


class AxisState(IntEnum):
    """States of an axis."""

    OFF = 0
    HOMING = 1
    IDLE = 2
    """Enabled and holding its position."""
    RUNNING = 3
    STOPPING = 4
    FAULT = 5


class SampleFlag(IntFlag):
    """What happened to an axis in a tick."""

    SATURATED = 1 << 0
    """The command stood at the voltage limit."""
    ADAPTING = 1 << 1
    """The estimator took this tick's data."""
    PROJECTED = 1 << 2
    """The estimate was projected onto its bounds or Assumption 2's half-plane."""
    HOMED = 1 << 3
    SKIPPED = 1 << 4
    """One or more whole periods were skipped right before this tick (overrun)."""
    LIMIT_NEGATIVE = 1 << 5
    LIMIT_POSITIVE = 1 << 6
    HOME_SWITCH = 1 << 7
    INDEX = 1 << 8
    HELD = 1 << 9
    """The driver had no new sample: the position is the last one, or the model's prediction."""
    BETWEEN = 1 << 10
    """No tick of the axis, which has fewer than the loop: the row repeats its last."""
    LEFT_OUT = 1 << 11
    """With HELD: a sample came, but no motion of the axis explains it, so the model stood in."""


class FaultCause(IntEnum):
    """Why an axis is in the state FAULT."""

    NONE = 0
    FOLLOWING_ERROR = 1
    SOFT_LIMIT = 2
    OVERSPEED = 3
    NOT_A_NUMBER = 4
    ENCODER_LOST = 5
    ENCODER_JUMP = 6
    AMPLIFIER = 7
    COMMUNICATION = 8
    ESTOP = 9
    LIMIT_SWITCH = 10
    HOMING_FAILED = 11
    OVERRUN = 12
    SUPERVISOR_LOST = 13
    NO_NEW_SAMPLE = 14
    """The driver had no new sample for more ticks than the configuration allows."""


TICK_SAMPLE = np.dtype(
    [
        ("tick", "i8"),  # counts periods; a gap is a skipped period
        ("time_s", "f8"),  # scheduled time since the first tick
        ("lateness_s", "f8"),  # wake-up after the scheduled time
        ("turnaround_s", "f8"),  # wake-up to the end of the write
        ("read_s", "f8"),  # parts of it
        ("compute_s", "f8"),
        ("write_s", "f8"),
    ],
    align=True,
)


def axis_sample(parameters: int) -> np.dtype[np.void]:
    """Return the record of one axis in one tick, for a theta of at most `parameters` entries."""
    return np.dtype(
        [
            ("reference_m", "f8"),
            ("reference_velocity_m_s", "f8"),
            ("reference_acceleration_m_s2", "f8"),
            ("position_m", "f8"),
            ("velocity_m_s", "f8"),  # difference of two positions
            ("following_error_m", "f8"),  # position - reference
            ("command_v", "f8"),  # as written to the driver, after every limit
            ("virtual_command_v", "f8"),  # v, before the inverse of the input map
            ("d0_hat_v", "f8"),
            ("theta_hat", "f8", (parameters,)),
            ("state", "i4"),  # AxisState
            ("fault", "i4"),  # FaultCause
            ("flags", "u4"),  # SampleFlag
            ("device_status", "u4"),  # motorctl.hal.Status, as the driver gave it
        ],
        align=True,
    )
