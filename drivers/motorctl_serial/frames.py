"""Frames on the wire: CRC-16, COBS, and the commands of each period, as compiled kernels."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from motorctl_serial.protocol import LONGEST_BODY, VOLT_CODES

Bytes = NDArray[np.uint8]

CRC_POLYNOMIAL = 0x1021
CRC_START = 0xFFFF
CRC_BYTES = 2
DELIMITER_BYTES = 1
COBS_BYTES = 1
"""COBS' overhead of a frame of at most 254 bytes, and none is longer."""
COBS_LONGEST_BLOCK = 254
LONGEST_CODED = LONGEST_BODY + CRC_BYTES + COBS_BYTES
"""Bytes before the delimiter."""
OVERHEAD_BYTES = CRC_BYTES + COBS_BYTES + DELIMITER_BYTES


def _crc_table() -> NDArray[np.uint16]:
    table = np.zeros(256, np.uint16)
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (CRC_POLYNOMIAL if crc & 0x8000 else 0)
        table[byte] = crc & 0xFFFF
    return table


_CRC_TABLE = _crc_table()


@njit(cache=True)
def crc16(data: Bytes, size: int) -> int:
    """Return the CRC of the first `size` bytes."""
    crc = CRC_START
    for i in range(size):
        crc = ((crc << 8) & 0xFFFF) ^ _CRC_TABLE[((crc >> 8) ^ data[i]) & 0xFF]
    return crc


@njit(cache=True)
def cobs_encode(data: Bytes, size: int, coded: Bytes) -> int:
    """Encode bytes without any zero (COBS).

    Parameters
    ----------
    data
        The bytes to encode, the first `size` of them.
    size
        How many.
    coded
        Receives the code; must hold size + size // 254 + 1 bytes.

    Returns
    -------
    int
        Number of coded bytes, without delimiter.
    """
    code_at, fill = 0, 1
    for i in range(size):
        if data[i] != 0:
            coded[fill] = data[i]
            fill += 1
        if data[i] == 0 or fill - code_at > COBS_LONGEST_BLOCK:
            coded[code_at] = fill - code_at
            code_at = fill
            fill += 1
    coded[code_at] = fill - code_at
    return fill


@njit(cache=True)
def cobs_decode(coded: Bytes, size: int, data: Bytes) -> int:
    """Restore the zeros of coded bytes (COBS).

    Parameters
    ----------
    coded
        The code without delimiter, the first `size` bytes of it.
    size
        How many.
    data
        Receives the decoded bytes; must hold `size` bytes.

    Returns
    -------
    int
        Number of decoded bytes; -1 where the code is invalid.
    """
    at, fill = 0, 0
    while at < size:
        code = int(coded[at])
        end = at + code
        if code == 0 or end > size:
            return -1
        for i in range(at + 1, end):
            if coded[i] == 0:
                return -1
            data[fill] = coded[i]
            fill += 1
        at = end
        if code <= COBS_LONGEST_BLOCK and at < size:
            data[fill] = 0
            fill += 1
    return fill


@njit(cache=True)
def put_frame(body: Bytes, size: int, wire: Bytes) -> int:
    """Append the CRC to a body, encode and delimit it.

    Parameters
    ----------
    body
        The frame's body; must have room for the CRC behind its `size` bytes.
    size
        Length of the body in bytes.
    wire
        Receives the frame.

    Returns
    -------
    int
        Number of bytes on the wire.
    """
    crc = crc16(body, size)
    body[size] = crc & 0xFF
    body[size + 1] = crc >> 8
    coded = cobs_encode(body, size + CRC_BYTES, wire)
    wire[coded] = 0
    return coded + DELIMITER_BYTES


@njit(cache=True)
def put_command(
    frame: int,
    sequence: int,
    volts: NDArray[np.float64],
    enable: Bytes,
    numbers: NDArray[np.int64],
    channels: int,
    codes_per_volt: float,
    body: Bytes,
    wire: Bytes,
) -> int:
    """Make a COMMAND or EXCHANGE; return its number of bytes on the wire.

    Volts beyond full scale are clamped; NaN becomes 0 V and disabled.

    Parameters
    ----------
    frame
        Type of the frame.
    sequence
        Sequence number, 0 to 255.
    volts, enable
        Command of each entry [V], and whether it is enabled; shape (n,).
    numbers
        The device's channel of each entry, shape (n,); channels without an entry stay disabled.
    channels
        Channels in the frame.
    codes_per_volt
        Scale [codes/V].
    body, wire
        Work space, and the frame that results.
    """
    size = 3 + 2 * channels
    body[:size] = 0
    body[0] = frame
    body[1] = sequence
    for i in range(numbers.size):
        if enable[i] == 0 or np.isnan(volts[i]):
            continue
        number = numbers[i]
        level = min(max(volts[i] * codes_per_volt, -float(VOLT_CODES)), float(VOLT_CODES))
        code = int(np.rint(level))
        body[2] |= 1 << number
        body[3 + 2 * number] = code & 0xFF
        body[4 + 2 * number] = (code >> 8) & 0xFF
    return put_frame(body, size, wire)


def frame_of(body: bytes) -> bytes:
    """Return a body as a frame on the wire; slow, not for the tick."""
    room = np.zeros(LONGEST_BODY + CRC_BYTES, np.uint8)
    room[: len(body)] = np.frombuffer(body, np.uint8)
    wire = np.zeros(LONGEST_BODY + OVERHEAD_BYTES, np.uint8)
    return wire[: int(put_frame(room, len(body), wire))].tobytes()
