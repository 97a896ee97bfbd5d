"""A coupler of two channels on Modbus TCP or RTU, written from docs/drivers/modbus.md alone.

What the page leaves to the Modbus specification is from that: frames, function codes 16 and 23.
"""

from __future__ import annotations

import os
import select
import socket
import struct
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from served_peer import PtyPeer, ServedPeer

VOLTS_PER_COUNT = 0.30518509476e-3
CHAIN_CLOSED = 1 << 12


class Coupler:
    """The registers and what they mean; `answer` serves one request."""

    def __init__(self) -> None:
        self.boot = 41
        self.counts, self.volts, self.enabled = [0, 0], np.zeros(2), np.zeros(2, bool)
        self.outputs = [0] * 4
        self.silent = False
        self.faults: deque[np.random.Generator | None] = deque()
        self.heard = 0

    def restart(self) -> None:
        self.boot += 1
        self.counts, self.outputs = [0, 0], [0] * 4
        self._apply()

    def _apply(self) -> None:
        codes = np.array(self.outputs[:2], np.uint16).astype(np.int16)
        self.enabled = np.array([self.outputs[2] & 1, self.outputs[2] >> 1 & 1], bool)
        self.volts = codes * VOLTS_PER_COUNT

    def _write(self, first: int, data: bytes) -> None:
        values = struct.unpack(f">{len(data) // 2}H", data)
        self.outputs[first : first + len(values)] = values
        self._apply()

    def answer(self, request: bytes) -> bytes:
        """Serve a request from its function code on."""
        self.heard += 1
        if request[0] == 16:
            first, quantity, size = struct.unpack_from(">HHB", request, 1)
            assert size == 2 * quantity == len(request) - 6
            self._write(first, request[6:])
            return request[:5]
        if request[0] != 23:
            return bytes([request[0] | 0x80, 1])
        read, many, first, quantity, size = struct.unpack_from(">HHHHB", request, 1)
        assert size == 2 * quantity == len(request) - 10
        self._write(first, request[10:])
        inputs = struct.pack(">ii", *self.counts) + bytes(8)
        inputs += struct.pack(">HHH", CHAIN_CLOSED, self.outputs[3], self.boot)
        return bytes([23, 2 * many]) + inputs[2 * read : 2 * (read + many)]

    def fault(self) -> np.random.Generator | bool | None:
        """Return what becomes of the next answer: False is nothing, None is lost."""
        if self.silent:
            return None
        return self.faults.popleft() if self.faults else False


def damaged(answer: bytes, random: np.random.Generator) -> bytes:
    """Turn an answer into another one of the same kind that says something wrong."""
    kind = random.integers(3)
    if kind == 0:
        return bytes([0x97, random.integers(1, 12)])  # an exception
    if kind == 1:
        short = 2 * int(random.integers(1, 11))  # too few registers
        return bytes([23, short]) + answer[2 : 2 + short]
    wrong = (int.from_bytes(answer[20:22], "big") + int(random.integers(1, 60000))) % 65536
    return answer[:20] + wrong.to_bytes(2, "big") + answer[22:]  # the echo of another request


class TcpPeer(ServedPeer, Coupler):
    """The coupler on TCP, in a thread."""

    def __init__(self, port: int) -> None:
        super().__init__()
        self.port = port

    def begin(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self.begin_serving()

    def end(self) -> None:
        self.end_serving()

    def _run(self) -> None:
        hosts: dict[socket.socket, bytes] = {}
        while self._running:
            for ready in select.select([self._listener, *hosts], [], [], 0.02)[0]:
                if ready is self._listener:
                    host, _ = ready.accept()
                    host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    hosts[host] = b""
                    continue
                try:
                    came = ready.recv(512)
                    hosts[ready] = self._serve(ready, hosts[ready] + came)
                except OSError:
                    came = b""
                if not came:
                    ready.close()
                    del hosts[ready]
        for each in (self._listener, *hosts):
            each.close()

    def _serve(self, host: socket.socket, pending: bytes) -> bytes:
        while len(pending) >= 7:
            transaction, protocol, size, unit = struct.unpack_from(">HHHB", pending)
            if len(pending) < 6 + size:
                break
            request, pending = pending[7 : 6 + size], pending[6 + size :]
            answer, fault = self.answer(request), self.fault()
            if fault is None:
                continue
            if fault:
                kind = fault.integers(5)
                transaction ^= 0x4000 if kind == 0 else 0
                unit += kind == 1
                answer = damaged(answer, fault) if kind > 1 else answer
            header = struct.pack(">HHHB", transaction, protocol, len(answer) + 1, unit)
            host.sendall(header + answer)
        return pending


class RtuPeer(PtyPeer, Coupler):
    """The coupler on a serial port."""

    def __init__(self, port: Path) -> None:
        super().__init__()
        self.port = port

    def _run(self) -> None:
        pending = b""
        while self._running:
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            pending += os.read(self._master, 512)
            # Where this thread had no CPU several may have come: one left over would make every
            # later answer that of the request before.
            while (size := self._size(pending)) is not None and len(pending) >= size:
                frame, pending = pending[:size], pending[size:]
                assert crc16(frame) == 0, frame.hex()
                answer, fault = self.answer(frame[1:-2]), self.fault()
                if fault is not None:
                    os.write(self._master, self._reply(frame[:1] + answer, fault or None))

    @staticmethod
    def _size(frame: bytes) -> int | None:
        where = {16: 6, 23: 10}.get(frame[1]) if len(frame) > 1 else None
        return where + 3 + frame[where] if where and len(frame) > where else None

    @staticmethod
    def _reply(reply: bytes, random: np.random.Generator | None) -> bytes:
        if random is not None and random.random() < 0.5:
            reply = reply[:1] + damaged(reply[1:], random)
        elif random is not None:
            place, crc = int(random.integers(len(reply))), crc16(reply)
            flipped = reply[place] ^ 1 << int(random.integers(8))
            return reply[:place] + bytes([flipped]) + reply[place + 1 :] + struct.pack("<H", crc)
        return reply + struct.pack("<H", crc16(reply))


def crc16(data: bytes) -> int:
    """Compute the CRC of Modbus, bit by bit; 0 for a frame with its CRC."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def layout() -> dict[str, Any]:
    """Return the page's example layout."""
    channels = {}
    names = ("encoder_lost", "amplifier_fault", "limit_negative", "limit_positive", "home_switch")
    for i in range(2):
        status = {name: {"address": 8, "bit": 6 * i + k} for k, name in enumerate(names)}
        status["index_latched"] = {"address": 8, "bit": 6 * i + 5}
        status["estop"] = {"address": 8, "bit": 12, "inverted": True}
        channels[i] = {
            "volts": {
                "address": i,
                "bits": 16,
                "signed": True,
                "volts_per_count": VOLTS_PER_COUNT,
            },
            "enable": {"address": 2, "bit": i},
            "counts": {"address": 2 * i, "bits": 32, "signed": True},
            "index_counts": {"address": 4 + 2 * i, "bits": 32, "signed": True},
            "status": status,
        }
    return {
        "unit": 1,
        "device_turnaround_s": 0.1e-3,
        "channels": channels,
        "sequence": {"output": 3, "input": 9},
        "boot_id": {"address": 10},
    }
