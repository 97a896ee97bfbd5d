"""What supervisor and loop process say to each other: verbs, replies, phases, what is degraded."""

from __future__ import annotations

from enum import IntEnum, IntFlag

STATUS_ROWS = 8
"""Ticks for which the loop keeps the axes' status, so that nobody reads one that is written."""


class Verb(IntEnum):
    """What the supervisor can ask of the loop."""

    START = 1
    STOP = 2
    HOME = 3
    FOLLOW = 4
    """Follow the program in the command's slot, from the command's tick on (0: at once)."""
    RESET = 5
    ESTOP = 6
    SHUTDOWN = 7
    """Stop every axis, make the outputs safe, end the process."""
    EXCITE = 8
    """Add the axis' excitation to its command, for so many periods. It changes no state."""


class Reply(IntEnum):
    """What the loop answers."""

    OK = 1
    WRONG_STATE = 2
    NOT_HOMED = 3
    NOT_AT_START = 4
    """The program does not begin where the axis stands."""
    STILL_FAULTY = 5
    """What caused the fault is still there."""
    NO_HOMING = 6
    """The axis has an absolute encoder: there is nothing to home."""
    LATE = 7
    """The tick at which the program should have begun has passed."""
    STILL_MOVING = 8
    """The axis still moves: it can be enabled when it stands."""
    CAUSE_LASTS = 9
    """The motor is still warm, the axis too fast, or its encoder noisy."""
    NOT_POWERED = 10
    """The amplifier is not on yet: what moves the axis would begin without it."""
    EXCITED = 11
    """The axis is excited already."""


class Phase(IntEnum):
    """How far the loop process is."""

    STARTING = 0
    COMPILING = 1
    RUNNING = 2
    STOPPED = 3
    FAILED = 4


class Degraded(IntFlag):
    """What of real time this run does without."""

    NO_FIFO = 1 << 0
    NO_PINNING = 1 << 1
    NO_LOCKED_MEMORY = 1 << 2
    NO_CPU_LATENCY = 1 << 3
    KERNEL_NOT_RT = 1 << 4
    CPU_NOT_ISOLATED = 1 << 5
    CPU_SHARED = 1 << 6


class Word(IntEnum):
    """Words of the loop's status that announce data."""

    PHASE = 0
    """Announces process id, notes, message and what real time is lacking."""
    RING_HEAD = 1
    """Announces a row of the ring, and a row of the axes' status."""
    MAIL_HEAD = 2
    """Announces a command, and the program or the excitation that it begins."""
    MAIL_TAIL = 3
    """Announces replies."""
    REOPEN_ASKED = 4
    """Announces of which axis the driver is to be opened anew."""
    REOPEN_DONE = 5
    """Announces what came of that."""
    MODELS_DONE = 6
    """Announces what came of an order for other models."""
