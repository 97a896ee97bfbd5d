"""Frames of the serial protocol: COBS, CRC-16, one byte 00 at the end."""

from __future__ import annotations

import binascii
from enum import IntEnum

LONGEST_BODY = 250
LONGEST_WIRE = 253
"""Bytes before the 00 that ends a frame."""


class Kind(IntEnum):
    """Types of frames."""

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


class Refusal(IntEnum):
    """Codes of ERROR."""

    VERSION = 1
    NO_SESSION = 2
    TOO_MANY_CHANNELS = 3
    MODE = 4
    TOO_FAST = 5
    WATCHDOG = 6
    BAD_LENGTH = 7
    UNKNOWN_TYPE = 8
    BAD_VALUE = 9


def to_wire(body: bytes) -> bytes:
    """Return a body as it is sent: with CRC, encoded and delimited."""
    # crc_hqx is the polynomial 0x1021, not reflected, from the given start value.
    framed = body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "little")
    pieces = [bytes((len(piece) + 1,)) + piece for piece in framed.split(b"\0")]
    return b"".join(pieces) + b"\0"


def from_wire(wire: bytes) -> bytes | None:
    """Return the body in the bytes before a 00; None where they are no frame."""
    if not 5 <= len(wire) <= LONGEST_WIRE:
        return None
    framed = bytearray()
    place = 0
    while place < len(wire):
        end = place + wire[place]
        if end > len(wire) or end == place:
            return None
        framed += wire[place + 1 : end]
        framed.append(0)
        place = end
    del framed[-1]
    body = bytes(framed[:-2])
    if binascii.crc_hqx(body, 0xFFFF) != int.from_bytes(framed[-2:], "little"):
        return None
    return body if len(body) <= LONGEST_BODY else None
