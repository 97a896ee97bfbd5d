"""The protocol's numbers and the bodies of its slow frames; ``docs/drivers/serial.md`` tells all.

A body is type, sequence number and fields. What the loop sends and takes each period is coded in
`motorctl_serial.frames` and `motorctl_serial.receiver`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

VERSION = 1
MOST_CHANNELS = 8
VOLT_CODES = 32767
LONGEST_BODY = 250
FIRST_DEVICE_TYPE = 0x80

STATE_HEAD_BYTES = 7
STATE_CHANNEL_BYTES = 5
STATE_INDEX_BYTES = 4
COMMAND_HEAD_BYTES = 3
COMMAND_CHANNEL_BYTES = 2
BARE_BYTES = 2
"""A body without fields."""

_HELLO = struct.Struct("<BBBBBBHI")
_CAPABILITIES = struct.Struct("<BBBBBBBBHHII16s")
_ERROR = struct.Struct("<BBBBBH")
CAPABILITIES_BYTES = _CAPABILITIES.size
ERROR_BYTES = _ERROR.size


class FrameType(IntEnum):
    """The first byte of a body."""

    HELLO = 0x01
    COMMAND = 0x02
    EXCHANGE = 0x03
    POLL = 0x04
    START_STREAM = 0x05
    STOP_STREAM = 0x06
    SAFE = 0x07
    CAPABILITIES = 0x81
    STATE = 0x82
    ERROR = 0x83


class Mode(IntFlag):
    """How samples are asked for, as in HELLO and CAPABILITIES."""

    POLL = 1
    EXCHANGE = 2
    STREAM = 4


class StateFlag(IntFlag):
    """The flags of STATE."""

    IN_FORCE = 1
    WATCHDOG = 2
    REFUSED = 4


class ErrorCode(IntEnum):
    """Why a device refused a frame."""

    VERSION = 1
    NO_SESSION = 2
    TOO_MANY_CHANNELS = 3
    MODE = 4
    TOO_FAST = 5
    WATCHDOG = 6
    BAD_LENGTH = 7
    UNKNOWN_TYPE = 8
    BAD_VALUE = 9
    NOT_READY = 10


@dataclass(frozen=True)
class Capabilities:
    """What a device says of itself."""

    sequence: int
    lowest: int
    highest: int
    answers: int
    channels: int
    counter_bits: int
    modes: Mode
    watchdog_ms: int
    max_rate_hz: int
    boot_id: int
    full_scale_v: float
    name: str


@dataclass(frozen=True)
class Refusal:
    """What an ERROR frame says."""

    sequence: int
    code: int
    about_type: int
    about_sequence: int
    detail: int

    def in_words(self) -> str:
        """Say it for people."""
        known = {
            ErrorCode.VERSION: f"it speaks versions {self.detail & 255} to {self.detail >> 8}",
            ErrorCode.TOO_MANY_CHANNELS: f"it has {self.detail} channels",
            ErrorCode.MODE: f"its modes are {_modes(self.detail)}",
            ErrorCode.TOO_FAST: f"its highest rate is {self.detail} Hz",
            ErrorCode.WATCHDOG: f"its longest watchdog is {self.detail} ms",
            ErrorCode.BAD_LENGTH: f"it expects {self.detail} bytes",
            ErrorCode.BAD_VALUE: f"at byte {self.detail}",
            ErrorCode.NOT_READY: f"its own number for that is {self.detail}",
        }
        if self.code not in ErrorCode._value2member_map_:
            return f"error {self.code}, detail {self.detail}"
        code = ErrorCode(self.code)
        return f"{code.name}: {known[code]}" if code in known else code.name


def hello(sequence: int, channels: int, mode: Mode, watchdog_ms: int, period_us: int) -> bytes:
    """Return the body of HELLO.

    Parameters
    ----------
    sequence
        Of the frame, 0 to 255.
    channels
        Of the session: the highest number in use plus one.
    mode
        How states are exchanged.
    watchdog_ms
        Time without a command after which the device disables its outputs [ms].
    period_us
        Of the loop [us].
    """
    return _HELLO.pack(
        FrameType.HELLO, sequence, VERSION, channels, mode, 0, watchdog_ms, period_us
    )


def bare(frame: FrameType, sequence: int) -> bytes:
    """Return the body of a frame without fields."""
    return bytes((frame, sequence))


def capabilities(body: bytes) -> Capabilities:
    """Read the body of CAPABILITIES."""
    fields = _CAPABILITIES.unpack(body)
    (_, sequence, lowest, highest, answers, channels, bits, modes) = fields[:8]
    (watchdog_ms, rate_hz, boot_id, full_scale_uv, name) = fields[8:]
    return Capabilities(
        sequence,
        lowest,
        highest,
        answers,
        channels,
        bits,
        Mode(modes & (Mode.POLL | Mode.EXCHANGE | Mode.STREAM)),
        watchdog_ms,
        rate_hz,
        boot_id,
        full_scale_uv * 1e-6,
        name.rstrip(b"\0").decode("ascii", "replace"),
    )


def refusal(body: bytes) -> Refusal:
    """Read the body of ERROR."""
    return Refusal(*_ERROR.unpack(body)[1:])


def _modes(bits: int) -> str:
    names = [(mode.name or "").lower() for mode in Mode if mode & bits]
    return ", ".join(names) or "none"
