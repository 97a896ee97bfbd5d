"""Modbus requests and answers after the application protocol specification V1.1b3.

Functions 3, 4, 6, 16 and 23, and their exceptions. Nothing here knows of a transport, nor of
what the registers mean.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY, READ_WRITE = 3, 4, 6, 16, 23
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
MOST_READ, MOST_WRITTEN, MOST_WRITTEN_IN_EXCHANGE = 125, 123, 121
MOST_IN_PDU = 253

_TWO = struct.Struct(">HH")
_EXCHANGE = struct.Struct(">HHHHB")


class Block(NamedTuple):
    """A range of registers that exists."""

    start: int
    size: int


class RefusedError(Exception):
    """A request cannot be served; carries the exception code for the answer."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"Modbus exception {code}")


class Table:
    """Registers of one kind, as the big-endian bytes that travel; some ranges of them exist."""

    def __init__(self, *blocks: Block) -> None:
        self._blocks = blocks
        self.data = bytearray(2 * 65536)

    def extend(self, block: Block) -> None:
        """Let one more range exist."""
        self._blocks = (*self._blocks, block)

    def span(self, start: int, count: int) -> slice:
        """Return these registers' slice of `data`. Raises RefusedError where one is missing."""
        end = start + count
        for block in self._blocks:
            if block.start <= start and end <= block.start + block.size:
                return slice(2 * start, 2 * end)
        raise RefusedError(ILLEGAL_ADDRESS)


class Registers:
    """The two images of a Modbus device: what it shows, and what it is told.

    All are holding registers, and input registers show the same as far as they are shown at all.
    Where both images have the same address, reading gives what the device shows. `refresh` is
    called before registers are read, and `written` after registers changed, with their start and
    count; both may raise RefusedError.
    """

    def __init__(
        self,
        shown: Table,
        told: Table,
        refresh: Callable[[int, int], None],
        written: Callable[[int, int], None],
    ) -> None:
        self.shown, self.told = shown, told
        self._refresh, self._written = refresh, written

    def serve(self, request: bytes) -> bytes:
        """Return the answer to a request, both without address and checksum."""
        try:
            return self._serve(request)
        except RefusedError as refused:
            return bytes((request[0] | 0x80, refused.code))
        except (struct.error, IndexError):
            return bytes(((request[0] if request else 0) | 0x80, ILLEGAL_VALUE))

    def _serve(self, request: bytes) -> bytes:
        function = request[0]
        if function == READ_WRITE:
            start, count, to, written, _ = _EXCHANGE.unpack_from(request, 1)
            values = self._values(request, 9, written, MOST_WRITTEN_IN_EXCHANGE)
            # Both ranges must be there before anything happens; the sample is of before the write.
            self._readable(start, count)
            span = self.told.span(to, written)
            self._refresh(start, count)
            self._write(span, to, written, values)
        elif function in (READ_HOLDING, READ_INPUT):
            start, count = _TWO.unpack(request[1:])
            self._readable(start, count)
            self._refresh(start, count)
        elif function == WRITE_MANY:
            start, count = _TWO.unpack_from(request, 1)
            values = self._values(request, 5, count, MOST_WRITTEN)
            self._write(self.told.span(start, count), start, count, values)
            return request[:5]
        elif function == WRITE_ONE:
            start = _TWO.unpack(request[1:])[0]
            self._write(self.told.span(start, 1), start, 1, request[3:5])
            return request
        else:
            raise RefusedError(ILLEGAL_FUNCTION)
        table, span = self._readable(start, count)
        return bytes((function, 2 * count)) + table.data[span]

    def _readable(self, start: int, count: int) -> tuple[Table, slice]:
        if not 1 <= count <= MOST_READ:
            raise RefusedError(ILLEGAL_VALUE)
        try:
            return self.shown, self.shown.span(start, count)
        except RefusedError:
            return self.told, self.told.span(start, count)

    def _values(self, request: bytes, place: int, count: int, most: int) -> bytes:
        values = request[place + 1 :]
        if not 1 <= count <= most or request[place] != 2 * count or len(values) != 2 * count:
            raise RefusedError(ILLEGAL_VALUE)
        return values

    def _write(self, span: slice, start: int, count: int, values: bytes) -> None:
        before = self.told.data[span]
        self.told.data[span] = values
        try:
            self._written(start, count)
        except RefusedError:
            self.told.data[span] = before
            raise


def rtu_crc(data: bytes) -> int:
    """Compute the CRC-16 of Modbus RTU: polynomial 0x8005 reflected, start 0xFFFF."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def _table_entry(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


_TABLE = tuple(_table_entry(value) for value in range(256))
