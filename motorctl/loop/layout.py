"""How the memory between supervisor and loop process is laid out: what stands where."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np

from motorctl.log.sample import TICK_SAMPLE, axis_sample
from motorctl.loop.excitation import EXCITATION
from motorctl.loop.learned_feedforward import LEARNED
from motorctl.loop.vocabulary import STATUS_ROWS
from motorctl.motion import SEGMENT

HEADER_BYTES = 4096
NOTES_BYTES = 4096
REOPEN_TOLD_BYTES = 1024
MODELS_TOLD_BYTES = 1024
MAILBOX_SIZE = 64
KEPT_FOR_STOPS = 4
"""Of its places: whoever floods it with commands leaves room for an emergency stop."""
PROGRAM_SEGMENTS = 65536
"""Longest program of one axis, in segments."""
RING_SECONDS = 8.0

LOOP_STATUS = np.dtype(
    [
        ("pid", "i8"),
        ("phase", "i8"),
        ("beat", "i8"),  # written by the supervisor
        ("tick", "i8"),  # the last tick that was finished
        ("time_s", "f8"),
        ("overruns", "i8"),
        ("skipped_periods", "i8"),
        ("degraded", "u8"),
        ("ring_head", "i8"),  # rows written so far
        ("mail_head", "i8"),  # written by the supervisor
        ("mail_tail", "i8"),  # commands whose replies can be read
        ("mail_taken", "i8"),  # commands that the loop has taken; its own
        ("message", "S512"),  # why the process failed or ended
        ("notes", f"S{NOTES_BYTES}"),  # of the drivers, when they were opened, a line each
        ("reopen_asked", "i8"),  # drivers to open anew until now, one at a time; the supervisor's
        ("reopen_axis", "i8"),  # an axis of the last one; the supervisor's
        ("reopen_clears", "i8"),  # 1: its device is only to forget a fault; the supervisor's
        ("reopen_done", "i8"),  # orders of these that are done
        ("reopen_failed", "i8"),  # 1: the last one is not open
        ("reopen_told", f"S{REOPEN_TOLD_BYTES}"),  # why, or what it notes, a line each
        ("models_done", "i8"),  # the last order for other models that is done
        ("models_refused", "i8"),  # 1: the old ones go on
        ("models_told", f"S{MODELS_TOLD_BYTES}"),  # why
        ("models_row", "i8"),  # rows written so far when the models last changed
        ("models_row_before", "i8"),  # and at the change before that
    ],
    align=True,
)

COMMAND = np.dtype(
    [
        ("verb", "i8"),
        ("axis", "i8"),
        ("slot", "i8"),
        ("tick", "i8"),
        ("program", "i8"),  # a number that the axes of one program share; 0: it moves one alone
    ],
    align=True,
)


def axis_status(parameters: int) -> np.dtype[np.void]:
    """Return the dtype of one axis' status, for a theta of at most `parameters` entries."""
    return np.dtype(
        [
            ("state", "i4"),  # AxisState
            ("inner_state", "i4"),  # motorctl.loop.states.State
            ("fault", "i4"),  # FaultCause
            ("homed", "i4"),
            ("slot", "i4"),  # program slot in use, or -1
            ("position_m", "f8"),
            ("velocity_m_s", "f8"),
            ("reference_m", "f8"),
            ("reference_velocity_m_s", "f8"),
            ("following_error_m", "f8"),
            ("command_v", "f8"),
            ("d0_hat_v", "f8"),
            ("heat_v2", "f8"),  # of the motor: mean square of the command over its time constant
            ("theta_hat", "f8", (parameters,)),
            ("fault_value", "f8"),  # what tripped the limit
            ("fault_limit", "f8"),
            ("fault_time_s", "f8"),
            ("fault_status", "i8"),  # the driver's status word then
            ("device_status", "i8"),  # and now
            ("excitation_left", "i8"),  # ticks of the axis until its excitation ends; 0: none
            ("held_ticks", "i8"),  # without a new sample until now
            ("missed_ticks", "i8"),  # all of them since the loop began
            ("longest_missed_ticks", "i8"),
            ("skew_m", "f8"),  # of a dual drive; zero else, as the next ones
            ("skew_reference_m", "f8"),
            ("skew_command_v", "f8"),
            ("second_device_status", "i8"),
        ],
        align=True,
    )


Place = tuple[np.dtype[np.void] | np.dtype[np.int64], tuple[int, ...], int]
"""Type and shape of an array, and where in the memory it begins [bytes]."""


def places(layout: Mapping[str, int]) -> tuple[dict[str, Place], int]:
    """Return where each array stands, by its name, and how large the memory is [bytes].

    Parameters
    ----------
    layout
        How many `axes`, `parameters` of the longest theta, `ring_rows` and `segments` there are.
    """
    axes, parameters, rows = layout["axes"], layout["parameters"], layout["ring_rows"]
    parts: list[tuple[str, np.dtype[np.void] | str, tuple[int, ...]]] = [
        ("status", LOOP_STATUS, (1,)),
        ("axis_status_rows", axis_status(parameters), (STATUS_ROWS, axes)),
        ("mailbox", COMMAND, (MAILBOX_SIZE,)),
        ("replies", "i8", (MAILBOX_SIZE,)),
        ("segments", SEGMENT, (axes, 2, layout["segments"])),
        ("segment_counts", "i8", (axes, 2)),
        ("excitations", EXCITATION, (axes,)),
        ("learned", LEARNED, (axes, 2)),
        ("ticks", TICK_SAMPLE, (rows,)),
        ("samples", axis_sample(parameters), (rows, axes)),
    ]
    offset, found = HEADER_BYTES, {}
    for name, dtype, shape in parts:
        found[name] = (np.dtype(dtype), shape, offset)
        size = np.dtype(dtype).itemsize * int(np.prod(shape))
        offset += -(-size // 4096) * 4096
    return found, offset


def signature(layout: Mapping[str, int]) -> str:
    """Return what two programs have in common that mean the same by every byte of the memory."""
    found, size = places(layout)
    parts = [(name, dtype.descr, *rest) for name, (dtype, *rest) in found.items()]
    return hashlib.sha256(repr((parts, size)).encode()).hexdigest()
