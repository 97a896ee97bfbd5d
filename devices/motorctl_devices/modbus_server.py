"""Modbus over TCP and over a serial line (RTU), after their specifications."""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from motorctl.errors import RunError
from motorctl_devices.endpoint import Endpoint
from motorctl_devices.line import change_length, flip_bits
from motorctl_devices.machine import Machine
from motorctl_devices.modbus_image import Image
from motorctl_devices.modbus_pdu import (
    MOST_IN_PDU,
    READ_HOLDING,
    READ_INPUT,
    READ_WRITE,
    WRITE_MANY,
    WRITE_ONE,
    rtu_crc,
)
from motorctl_devices.pty_port import PtyPort
from motorctl_devices.schedule import Fault

_HEADER = struct.Struct(">HHHB")
MOST_CLIENTS = 16
SILENCE_NS = 1_750_000
"""t3.5 at and above 19200 baud: a pause that ends a frame."""


class Adu(NamedTuple):
    """A whole Modbus message, and which client it comes from or goes to."""

    peer: int
    data: bytes


class ModbusEndpoint(Endpoint[Adu]):
    """What TCP and RTU share: an image behind them, wire faults on whole messages."""

    image: Image

    def __init__(self, machine: Machine, faults: Sequence[Fault], unit: int, echoes: bool) -> None:
        super().__init__(machine, faults)
        self.unit, self._echoes = unit, echoes

    def time_ns(self) -> int:
        """Return when the request being served arrived [ns]."""
        return self.now_ns

    def echo(self, number: int) -> int:
        """Return the sequence number to show for the one that was written."""
        return self.sequence(number, 65536)

    def died(self) -> None:
        """Forget what the registers hold."""
        self.image.clear()

    def spoil(self, message: Adu, fault: Fault) -> Adu:
        """Flip bits anywhere in the message."""
        return Adu(message.peer, flip_bits(message.data, fault))

    def cut(self, message: Adu, fault: Fault) -> Adu:
        """Cut or lengthen the message."""
        return Adu(message.peer, change_length(message.data, fault, MOST_IN_PDU + 7))


class ModbusTcp(ModbusEndpoint):
    """A Modbus TCP server for a few clients."""

    def __init__(
        self,
        machine: Machine,
        faults: Sequence[Fault],
        unit: int,
        echoes: bool,
        host: str,
        port: int,
    ) -> None:
        super().__init__(machine, faults, unit, echoes)
        self._host, self._port = host, port
        self._server: socket.socket | None = None
        self._clients: dict[int, socket.socket] = {}
        self._buffers: dict[int, bytearray] = {}

    @property
    def address(self) -> str:
        """Return host:port."""
        return f"{self._host}:{self._port}"

    def open(self) -> None:
        """Listen. Raises RunError."""
        try:
            self._server = socket.create_server((self._host, self._port), backlog=4)
        except OSError as error:
            raise RunError(f"Modbus TCP {self.address}: {error.strerror}") from error
        self._server.setblocking(False)
        self._port = self._server.getsockname()[1]

    def close(self) -> None:
        """Stop listening and hang up on all clients.

        In this order: a client that sees the end and calls again at once is refused, not taken in
        by a server that closes.
        """
        if self._server is not None:
            self._server.close()
            self._server = None
        for number in list(self._clients):
            self._hang_up(number)

    def filenos(self) -> list[int]:
        """Return the file descriptors to wait on."""
        numbers = list(self._clients)
        if self._server is not None:
            numbers.append(self._server.fileno())
        return numbers

    def hear(self, ready: Sequence[int]) -> None:
        """Read requests; take in clients."""
        for number in ready:
            client = self._clients.get(number)
            if client is not None:
                self._read(number, client)
            elif self._server is not None and number == self._server.fileno():
                self._take_in(self._server)

    def _take_in(self, server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            client = server.accept()[0]
            if len(self._clients) >= MOST_CLIENTS:
                client.close()
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients[client.fileno()] = client
            self._buffers[client.fileno()] = bytearray()

    def _read(self, number: int, client: socket.socket) -> None:
        try:
            came = client.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            came = b""
        if not came:
            self._hang_up(number)
            return
        buffer = self._buffers[number]
        buffer += came
        while len(buffer) >= _HEADER.size:
            _, protocol, length, _ = _HEADER.unpack_from(buffer)
            if protocol != 0 or not 2 <= length <= MOST_IN_PDU + 1:
                self.refused += 1
                self._hang_up(number)  # the stream cannot be trusted any more
                return
            if len(buffer) < 6 + length:
                return
            adu = bytes(buffer[: 6 + length])
            del buffer[: 6 + length]
            self.heard(Adu(number, adu))
            if number not in self._clients:
                return

    def answer(self, message: Adu) -> None:
        """Serve one request."""
        data = message.data
        if len(data) < _HEADER.size + 1:
            self.refused += 1
            return
        transaction, _, _, unit = _HEADER.unpack_from(data)
        if unit not in (self.unit, 0, 255):
            self.refused += 1
            return
        answer = self.image.registers.serve(data[_HEADER.size :])
        number = transaction if self._echoes else self.sequence(transaction, 65536)
        header = _HEADER.pack(number, 0, len(answer) + 1, unit)
        self.say(Adu(message.peer, header + answer))

    def emit(self, message: Adu) -> None:
        """Send to the client, if it is still there."""
        client = self._clients.get(message.peer)
        if client is None:
            return
        try:
            client.send(message.data)
        except OSError:
            self._hang_up(message.peer)

    def babble(self, fault: Fault) -> None:
        """Send every client an answer that it did not ask for."""
        draw = fault.random.randrange
        registers = bytes(draw(256) for _ in range(8))
        for peer in list(self._clients):
            header = _HEADER.pack(draw(65536), 0, 3 + len(registers), self.unit)
            self.emit(Adu(peer, header + bytes((READ_HOLDING, len(registers))) + registers))

    def unplug(self) -> None:
        """Hang up and refuse connections."""
        super().unplug()
        self.close()

    def died(self) -> None:
        """Hang up: the connections are lost with the device's memory."""
        super().died()
        self.close()

    def booted(self) -> None:
        """Listen again on the same port. Raises RunError."""
        if self.plugged:
            self.open()

    def plug(self) -> None:
        """Listen again on the same port. Raises RunError."""
        super().plug()
        self.open()

    def _hang_up(self, number: int) -> None:
        self._clients.pop(number).close()
        del self._buffers[number]


class ModbusRtu(ModbusEndpoint):
    """A Modbus RTU server on a serial line."""

    def __init__(
        self,
        machine: Machine,
        faults: Sequence[Fault],
        unit: int,
        echoes: bool,
        link: Path | None,
    ) -> None:
        super().__init__(machine, faults, unit, echoes)
        self._port = PtyPort(link)
        self._buffer = bytearray()
        self._heard_ns = 0

    @property
    def address(self) -> str:
        """Return the path of the serial port."""
        return self._port.path

    def open(self) -> None:
        """Make the serial port. Raises RunError."""
        self._port.open()

    def close(self) -> None:
        """Take the serial port away."""
        self._port.close()

    def filenos(self) -> list[int]:
        """Return the file descriptors to wait on."""
        number = self._port.fileno()
        return [number] if number >= 0 else []

    def hear(self, ready: Sequence[int]) -> None:
        """Read requests: as long as their function says, after a pause at the latest anew."""
        if self._port.fileno() not in ready:
            return
        buffer = self._buffer
        if buffer and self.now_ns - self._heard_ns > SILENCE_NS:
            self.refused += 1
            buffer.clear()
        self._heard_ns = self.now_ns
        buffer += self._port.read()
        while buffer:
            length = _request_length(buffer)
            if length is None or len(buffer) < length:
                if len(buffer) > MOST_IN_PDU + 3 or length == 0:
                    self.refused += 1
                    buffer.clear()
                return
            adu = bytes(buffer[:length])
            del buffer[:length]
            self.heard(Adu(0, adu))

    def answer(self, message: Adu) -> None:
        """Serve one request, if its checksum is right and it is for this unit."""
        data = message.data
        if len(data) < 4 or rtu_crc(data[:-2]) != int.from_bytes(data[-2:], "little"):
            self.refused += 1
            self._buffer.clear()
            return
        unit = data[0]
        if unit not in (self.unit, 0):
            return
        body = bytes((self.unit,)) + self.image.registers.serve(data[1:-2])
        if unit:  # a broadcast has no answer
            self.say(Adu(0, body + rtu_crc(body).to_bytes(2, "little")))

    def emit(self, message: Adu) -> None:
        """Send to the host."""
        self._port.write(message.data)

    def babble(self, fault: Fault) -> None:
        """Send noise."""
        self._port.write(bytes(fault.random.randrange(256) for _ in range(8)))

    def unplug(self) -> None:
        """Take the port away."""
        super().unplug()
        self._port.close()

    def plug(self) -> None:
        """Open the port again. Raises RunError."""
        super().plug()
        self._buffer.clear()
        self._port.open()


def _request_length(buffer: bytearray) -> int | None:
    """Return the request's length in bytes; None: too short to tell, 0: unknown function."""
    if len(buffer) < 2:
        return None
    function = buffer[1]
    if function in (READ_HOLDING, READ_INPUT, WRITE_ONE):
        return 8
    place = {WRITE_MANY: 6, READ_WRITE: 10}.get(function)
    if place is None:
        return 0
    return place + 1 + buffer[place] + 2 if len(buffer) > place else None
