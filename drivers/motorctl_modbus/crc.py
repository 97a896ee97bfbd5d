"""The checksum of Modbus RTU: CRC-16 with the reflected polynomial 0xA001, begun with 0xFFFF."""

from __future__ import annotations


def _entry(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_TABLE = tuple(_entry(byte) for byte in range(256))


def crc16(data: bytearray | bytes, size: int) -> int:
    """Return the CRC of the first `size` bytes, to be sent lowest byte first.

    Over a frame with its CRC it is 0.
    """
    table, crc = _TABLE, 0xFFFF
    for i in range(size):
        crc = (crc >> 8) ^ table[(crc ^ data[i]) & 0xFF]
    return crc
