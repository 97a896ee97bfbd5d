"""A box of two channels on a pseudo-terminal, written from docs/drivers/serial.md alone."""

from __future__ import annotations

import os
import select
import struct
import time
from collections import deque
from pathlib import Path

import numpy as np
from served_peer import PtyPeer

FULL_SCALE_V = 12.0
HELLO, COMMAND, EXCHANGE, POLL, START_STREAM, STOP_STREAM, SAFE = range(1, 8)


def crc16(data: bytes) -> int:
    """Compute the page's CRC, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def to_wire(body: bytes) -> bytes:
    """Encode a body: CRC, COBS, zero."""
    pieces = (body + struct.pack("<H", crc16(body))).split(b"\0")
    return b"".join(bytes([len(piece) + 1]) + piece for piece in pieces) + b"\0"


def from_wire(coded: bytes) -> bytes | None:
    """Return the body of what came before a zero; None where it is no frame."""
    pieces, at = [], 0
    while at < len(coded):
        pieces.append(coded[at + 1 : at + coded[at]])
        at += coded[at]
    frame = b"\0".join(pieces)
    if at != len(coded) or len(frame) < 4:
        return None
    body, crc = frame[:-2], int.from_bytes(frame[-2:], "little")
    return body if crc16(body) == crc else None


class SerialPeer(PtyPeer):
    """The box on its port."""

    def __init__(self, port: Path) -> None:
        self.port = port
        self.boot = 0xB0070000
        self.number = self.sample = 0
        self.counts, self.volts, self.enabled = [0, 0], np.zeros(2), np.zeros(2, bool)
        self.period_s, self.session = 0.0, False
        self.force = (0, 0)
        """The number of the command in force, and 1 if there is one."""
        self.streaming: int | None = None
        self.silent = False
        self.faults: deque[np.random.Generator | None] = deque()
        self.heard = 0

    def restart(self) -> None:
        self.session, self.streaming, self.force = False, None, (0, 0)
        self.boot += 1
        self.sample, self.counts = 0, [0, 0]
        self._rest()

    def _rest(self) -> None:
        self.volts, self.enabled = np.zeros(2), np.zeros(2, bool)

    def _run(self) -> None:
        pending, due = b"", 0.0
        while self._running:
            wait = 0.02 if self.streaming is None else min(max(0.0, due - time.monotonic()), 0.02)
            if select.select([self._master], [], [], wait)[0]:
                *frames, pending = (pending + os.read(self._master, 512)).split(b"\0")
                for frame in frames:
                    body = from_wire(frame)
                    if body is not None:
                        self._obey(body)
                        self.heard += 1
            if self.streaming is not None and time.monotonic() >= due:
                self._state(self.streaming)
                due = max(due + self.period_s, time.monotonic())

    def _obey(self, body: bytes) -> None:
        kind, number = body[0], body[1]
        if kind == HELLO:
            _, n, _, _, watchdog_ms, period_us = struct.unpack("<BBBBHI", body[2:])
            assert n == 2
            self.session, self.streaming, self.force = True, None, (0, 0)
            self.period_s = period_us * 1e-6
            self._rest()
            fields = (1, 1, number, 2, 32, 7, watchdog_ms, 5000, self.boot, int(FULL_SCALE_V * 1e6))
            self._send(0x81, struct.pack("<BBBBBBHHII16s", *fields, b"peer"))
        elif kind == SAFE:
            self.force = (0, 0)
            self._rest()
        elif kind == STOP_STREAM:
            self.streaming = None
        elif not self.session:
            self._send(0x83, struct.pack("<BBBH", 2, kind, number, 0))
        elif kind in (COMMAND, EXCHANGE):
            enable, *codes = struct.unpack("<Bhh", body[2:])
            assert min(codes) > -32768
            self.enabled = np.array([enable & 1, enable >> 1 & 1], bool)
            self.volts = np.where(self.enabled, np.array(codes) * FULL_SCALE_V / 32767, 0.0)
            self.force = (number, 1)
            if kind == EXCHANGE:
                self._state(number)
        elif kind == POLL:
            self._state(number)
        elif kind == START_STREAM:
            self.streaming = number

    def _state(self, answers: int) -> None:
        self.sample = (self.sample + 1) % 65536
        fields = struct.pack("<BBBH", answers, *self.force, self.sample)
        for count in self.counts:
            fields += struct.pack("<Bi", 0, count)
        fault = self.faults.popleft() if self.faults else False
        if fault is None:
            self.number = (self.number + 1) % 256
        else:
            self._send(0x82, fields, fault or None)

    def _send(self, kind: int, fields: bytes, damage: np.random.Generator | None = None) -> None:
        wire = to_wire(bytes([kind, self.number]) + fields)
        self.number = (self.number + 1) % 256
        if damage is not None:
            wire = damaged(wire, damage)
        if not self.silent:
            os.write(self._master, wire)


def damaged(wire: bytes, random: np.random.Generator) -> bytes:
    """Flip a bit, leave bytes out, or put some in."""
    kind, place = random.integers(3), int(random.integers(1, len(wire)))
    if kind == 0:
        return wire[:place] + bytes([wire[place] ^ 1 << random.integers(8)]) + wire[place + 1 :]
    if kind == 1:
        return wire[:place]
    return wire[:place] + random.bytes(2) + wire[place:]
