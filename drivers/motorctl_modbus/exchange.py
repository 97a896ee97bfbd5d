"""One request a period and its reply, as bytes: made, sealed, judged. No I/O.

The request is made once by pymodbus' framer; a tick patches registers, transaction and checksum.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Final

from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadWriteMultipleRegistersRequest

from motorctl_modbus.crc import crc16
from motorctl_modbus.layout import InputBlock, OutputBlock

NOTHING: Final = 0
"""No reply that counts: none, a part of one, or one to an older request."""
REFUSED: Final = 1
"""Something came that is no reply to what was asked."""
EXCEPTION: Final = 2
"""The device answered the newest request with an exception; see `exception_code`."""
FRESH: Final = 3
"""The reply to the newest request; see `registers`."""

FUNCTION: Final = 23
MOST_OUTSTANDING: Final = 4
"""On TCP: more requests than this would be a queue of old commands in a device that stalls."""
PATIENCE_S: Final = 0.1
"""After so long without a reply one more request asks whether the device is back."""

HEADER: Final = struct.Struct(">HHHB")
REGISTER: Final = struct.Struct(">H")
LOW_FIRST: Final = struct.Struct("<H")
EXCEPTION_LENGTH: Final = 3


class Exchange(ABC):
    """What both framings share: the request, and a buffer for what comes."""

    MAY_INTERRUPT: ClassVar[bool] = False
    """Whether a request harms no reply that is still to come."""

    def __init__(self, request: bytes, data_at: int, reply_registers: int, room: int) -> None:
        self.request = bytearray(request)
        self.data_at = data_at
        """Where in `request` the registers begin."""
        self.registers: tuple[int, ...] = ()
        self.exception_code = 0
        self.on_late: Callable[[tuple[int, ...], int], None] | None = None
        """Called with the registers of a reply to an older request, and how many are newer."""
        self._unpack = struct.Struct(f">{reply_registers}H").unpack_from
        self._buffer = bytearray(room)
        self._view = memoryview(self._buffer)
        self._filled = 0
        self._sent_s = 0.0

    def space(self) -> memoryview:
        """Return the part of the buffer to receive into. Never empty after `judge`."""
        return self._view[self._filled :]

    def received(self, size: int) -> None:
        """Note that `size` bytes were put there."""
        self._filled += size

    @abstractmethod
    def may_send(self, now_s: float) -> bool:
        """Tell whether a request may go out now."""

    @abstractmethod
    def seal(self) -> None:
        """Finish the request once its registers are in."""

    @abstractmethod
    def sent(self, now_s: float) -> None:
        """Note that the sealed request went out."""

    @abstractmethod
    def judge(self, now_s: float) -> int:
        """Judge what was received: the best that came of it."""


class TcpExchange(Exchange):
    """Frames with an MBAP header: transaction, protocol 0, length, unit."""

    MAY_INTERRUPT = True

    def __init__(self, unit: int, outputs: OutputBlock, inputs: InputBlock) -> None:
        request = FramerSocket(DecodePDU(False)).buildFrame(_request(unit, outputs, inputs))
        super().__init__(request, 17, inputs.count, 4096)
        self._unit = unit
        self._bytes = 2 * inputs.count
        self._length = 3 + self._bytes
        self._newest = 0
        self._outstanding = 0

    def may_send(self, now_s: float) -> bool:
        """Not while several are unanswered, unless the last one was long ago."""
        return self._outstanding < MOST_OUTSTANDING or now_s - self._sent_s >= PATIENCE_S

    def seal(self) -> None:
        """Number the request."""
        REGISTER.pack_into(self.request, 0, (self._newest + 1) & 0xFFFF)

    def sent(self, now_s: float) -> None:
        """Wait for the reply to this transaction from now on."""
        self._newest = (self._newest + 1) & 0xFFFF
        self._outstanding = min(self._outstanding + 1, 0x7FFF)
        self._sent_s = now_s

    def judge(self, now_s: float) -> int:
        """Take every whole reply; the newest wins, of those to older requests `on_late` is told."""
        best, at, end = NOTHING, 0, self._filled
        while end - at >= HEADER.size:
            transaction, protocol, length, unit = HEADER.unpack_from(self._buffer, at)
            if protocol != 0 or length not in (self._length, EXCEPTION_LENGTH):
                # This device cannot have sent it: where the next frame begins is unknown.
                best, at = max(best, REFUSED), end
                break
            if end - at < 6 + length:
                break
            best = max(best, self._judge_one(at + 7, transaction, length, unit))
            at += 6 + length
        if at:
            self._buffer[: end - at] = self._buffer[at:end]
            self._filled = end - at
        return best

    def _judge_one(self, at: int, transaction: int, length: int, unit: int) -> int:
        age = (self._newest - transaction) & 0xFFFF
        if age >= self._outstanding or unit != self._unit:
            return REFUSED
        function, detail = self._buffer[at], self._buffer[at + 1]
        if length == EXCEPTION_LENGTH and function == FUNCTION | 0x80:
            verdict, self.exception_code = EXCEPTION, detail
        elif length == self._length and function == FUNCTION and detail == self._bytes:
            verdict = FRESH
        else:
            return REFUSED
        self._outstanding = age
        if verdict == FRESH:
            registers = self._unpack(self._buffer, at + 2)
            if not age:
                self.registers = registers
            elif self.on_late is not None:
                self.on_late(registers, age)
        return NOTHING if age else verdict


class RtuExchange(Exchange):
    """Frames with unit and checksum, and silence between them: nothing tells two replies apart."""

    def __init__(
        self, unit: int, outputs: OutputBlock, inputs: InputBlock, timeout_s: float, numbered: bool
    ) -> None:
        request = FramerRTU(DecodePDU(False)).buildFrame(_request(unit, outputs, inputs))
        super().__init__(request, 11, inputs.count, 512)
        self._unit = unit
        self._bytes = 2 * inputs.count
        self._size = 5 + self._bytes
        self._timeout_s = timeout_s
        self._numbered = numbered
        self._outstanding = False
        self._spoiled = False

    def may_send(self, now_s: float) -> bool:
        """Not while a reply may still come; and after a missing one the line is left alone once.

        Without sequence numbers a late reply would pass for that to the next request.
        """
        if not self._outstanding:
            return True
        if now_s - self._sent_s < self._timeout_s:
            return False
        self._outstanding = False
        return self._numbered

    def seal(self) -> None:
        """Add the checksum."""
        body = len(self.request) - 2
        LOW_FIRST.pack_into(self.request, body, crc16(self.request, body))

    def sent(self, now_s: float) -> None:
        """Wait for a reply from now on; discard the bytes received before."""
        self._outstanding, self._spoiled = True, False
        self._filled = 0
        self._sent_s = now_s

    def judge(self, now_s: float) -> int:
        """Take exactly one whole frame: anything more, less or else is refused."""
        buffer, filled = self._buffer, self._filled
        if filled == 0:
            return NOTHING
        if not self._outstanding or self._spoiled:
            self._filled = 0
            return REFUSED
        failed = filled > 1 and buffer[1] == FUNCTION | 0x80
        size = 5 if failed else self._size
        if filled < size:
            hopeless = now_s - self._sent_s >= self._timeout_s or not self._may_become_one(failed)
            return self._spoil() if hopeless else NOTHING
        if filled > size:
            return self._spoil()
        self._filled = 0
        self._outstanding = False
        if buffer[0] != self._unit or crc16(buffer, size):
            return REFUSED
        if failed:
            self.exception_code = buffer[2]
            return EXCEPTION
        if buffer[1] != FUNCTION or buffer[2] != self._bytes:
            return REFUSED
        self.registers = self._unpack(buffer, 3)
        return FRESH

    def _may_become_one(self, failed: bool) -> bool:
        buffer, filled = self._buffer, self._filled
        if buffer[0] != self._unit or (filled > 1 and buffer[1] & 0x7F != FUNCTION):
            return False
        return failed or filled < 3 or buffer[2] == self._bytes

    def _spoil(self) -> int:
        # What still comes until the next request belongs to this and is thrown away with it.
        self._filled, self._spoiled = 0, True
        return REFUSED


def _request(
    unit: int, outputs: OutputBlock, inputs: InputBlock
) -> ReadWriteMultipleRegistersRequest:
    return ReadWriteMultipleRegistersRequest(
        read_address=inputs.address,
        read_count=inputs.count,
        write_address=outputs.address,
        write_registers=outputs.off_registers(0),
        dev_id=unit,
    )
