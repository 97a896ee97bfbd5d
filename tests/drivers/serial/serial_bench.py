"""A box on a pseudo-terminal, written from docs/drivers/serial.md alone, and a driver before it."""

from __future__ import annotations

import binascii
import os
import select
import struct
import threading
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import real_time

from motorctl.hal import Channel, Inputs, Outputs
from motorctl_serial import SerialDriver, SerialOptions

PERIOD_S = 2e-3
HELLO, COMMAND, EXCHANGE, POLL, START_STREAM, STOP_STREAM, SAFE = range(1, 8)
CAPABILITIES, STATE, ERROR = 0x81, 0x82, 0x83
VERSION_REFUSED, NO_SESSION, TOO_MANY_CHANNELS, BAD_LENGTH, BAD_VALUE = 1, 2, 3, 7, 9
INDEX_LATCHED = 1 << 6


def slow_cobs(frame: bytes) -> bytes:
    """Code as the paper says: append a zero, cut after each zero or after 254 others."""
    rest, coded = frame + b"\0", b""
    while rest:
        piece, rest = rest[:254], rest[254:]
        if b"\0" in piece:
            at = piece.index(b"\0")
            rest = piece[at + 1 :] + rest
            piece = piece[:at]
        coded += bytes((len(piece) + 1,)) + piece
    return coded


def slow_uncobs(coded: bytes) -> bytes:
    frame = b""
    while coded:
        code, coded = coded[0], coded[1:]
        assert 0 < code <= len(coded) + 1
        frame += coded[: code - 1] + (b"\0" if code < 255 else b"")
        coded = coded[code - 1 :]
    return frame[:-1] if frame.endswith(b"\0") else frame


def framed(body: bytes) -> bytes:
    return slow_cobs(body + struct.pack("<H", binascii.crc_hqx(body, 0xFFFF))) + b"\0"


def state_body(
    sequence: int,
    sample: int,
    counts: list[int],
    answers: int = 0,
    in_force: int = 0,
    flags: int = 0,
    status: list[int] | None = None,
    index: list[int] | None = None,
) -> bytes:
    body = struct.pack("<BBBBBH", STATE, sequence & 255, answers, in_force, flags, sample & 0xFFFF)
    for word, count in zip(status or [0] * len(counts), counts, strict=True):
        body += struct.pack("<Bi", word, count)
    return body + b"".join(struct.pack("<i", mark) for mark in index or [])


class Box:
    """The device: a thread that reads its side of the pseudo-terminal and answers.

    Everything that a test may turn is an attribute.
    """

    def __init__(self, channels: int = 2, **settings: Any) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave  # held, so that the line stays up while no driver has it open
        self.channels = channels
        self.versions = (1, 1)
        self.counter_bits = 32
        self.modes = 7
        self.max_rate_hz = 5000
        self.boot_id = 0xC0FFEE01
        self.full_scale_v = 10.0
        self.name = "bench box"
        self.armed_ms: int | None = None
        self.mute = False
        self.refuses = False  # every command, for its value
        self.delay_s = 0.0
        self.mangle: Callable[[bytes], bytes] = lambda wire: wire
        self.counts = [0] * channels
        self.status = [0] * channels
        self.marks: list[tuple[int, int]] = [(0, 0)] * channels  # how often to tell, count
        self.volts = [0.0] * channels
        self.enabled = [False] * channels
        self.heard: deque[bytes] = deque(maxlen=64)
        self.watchdog_tripped = False
        self._session: tuple[int, int, int, float] | None = None
        self.sequence = self.sample = self._in_force = 0
        self._has_command = self._refused = False
        self._stream_due_s: float | None = None
        self._stream_answers = 0
        self._fed_s = 0.0
        self._pending = b""
        self._stop, self._running = os.pipe(), False
        for name, value in settings.items():
            assert hasattr(self, name), name
            setattr(self, name, value)
        real_time.begins()
        self._thread = threading.Thread(target=self._serve)

    def start(self) -> None:
        self._running = True
        self._thread.start()

    def end(self) -> None:
        if self._running:
            self._running = False
            os.write(self._stop[1], b"x")
            self._thread.join()
        for fd in (*self._stop, self.master, self._slave):
            if fd >= 0:
                os.close(fd)
        self._stop, self.master, self._slave = (-1, -1), -1, -1

    def vanish(self) -> None:
        """Pull the plug out of the host."""
        self.end()

    def restart(self, *, announce: bool = False) -> None:
        self._session, self._stream_due_s = None, None
        self._zero()
        self.boot_id += 1
        self.sequence = 0
        if announce:
            self._send(self._capabilities(0, 0))

    def pass_mark(self, channel: int, count: int) -> None:
        self.marks[channel] = (4, count)

    def send_raw(self, wire: bytes) -> None:
        os.write(self.master, wire)

    def _serve(self) -> None:
        os.set_blocking(self.master, False)
        while self._running:
            now = time.monotonic()
            dues = [d for d in (self._stream_due_s, self._watchdog_due()) if d is not None]
            timeout = max(0.0, min(dues) - now) if dues else None
            ready = select.select([self.master, self._stop[0]], [], [], timeout)[0]
            if self.master in ready:
                try:
                    self._pending += os.read(self.master, 4096)
                except OSError:
                    time.sleep(1e-3)
                *wires, self._pending = self._pending.split(b"\0")
                for wire in filter(None, wires):
                    self._receive(wire)
            now = time.monotonic()
            due = self._watchdog_due()
            if due is not None and now >= due:
                self._zero()
                self.watchdog_tripped = True
            if self._stream_due_s is not None and now >= self._stream_due_s:
                assert self._session is not None
                self._stream_due_s += self._session[2] * 1e-6
                self._state(self._stream_answers)

    def _watchdog_due(self) -> float | None:
        if not any(self.enabled) or self._session is None:
            return None
        return self._fed_s + self._session[3]

    def _zero(self) -> None:
        self.volts, self.enabled = [0.0] * self.channels, [False] * self.channels
        self._has_command = False

    def _receive(self, wire: bytes) -> None:
        frame = slow_uncobs(wire)
        body, crc = frame[:-2], struct.unpack("<H", frame[-2:])[0]
        assert crc == binascii.crc_hqx(body, 0xFFFF), "the host sends no damaged frame"
        self.heard.append(body)
        kind, sequence = body[0], body[1]
        if kind == HELLO:
            self._hello(sequence, body)
        elif kind == SAFE:
            self._zero()
            self.watchdog_tripped = False
        elif kind == STOP_STREAM:
            self._stream_due_s = None
        elif self._session is None:
            self._error(NO_SESSION, kind, sequence, 0)
        elif kind in (COMMAND, EXCHANGE):
            self._command(kind, sequence, body)
        elif kind == POLL:
            self._state(sequence)
        elif kind == START_STREAM:
            self._stream_answers = sequence
            self._stream_due_s = time.monotonic()

    def _hello(self, sequence: int, body: bytes) -> None:
        self._session, self._stream_due_s = None, None
        self._zero()
        self.watchdog_tripped = False
        version, channels, mode, _, watchdog_ms, period_us = struct.unpack("<BBBBHI", body[2:])
        if not self.versions[0] <= version <= self.versions[1]:
            detail = self.versions[0] + 256 * self.versions[1]
            self._error(VERSION_REFUSED, HELLO, sequence, detail)
        elif channels > self.channels:
            self._error(TOO_MANY_CHANNELS, HELLO, sequence, self.channels)
        else:
            self._session = (channels, mode, period_us, watchdog_ms * 1e-3)
            self._send(self._capabilities(sequence, self.armed_ms or watchdog_ms))

    def _capabilities(self, answers: int, watchdog_ms: int) -> bytes:
        return struct.pack(
            "<BBBBBBBBHHII16s",
            CAPABILITIES, self._number(), *self.versions, answers, self.channels,
            self.counter_bits, self.modes, watchdog_ms, self.max_rate_hz, self.boot_id,
            round(self.full_scale_v * 1e6), self.name.encode(),
        )  # fmt: skip

    def _command(self, kind: int, sequence: int, body: bytes) -> None:
        assert self._session is not None
        channels = self._session[0]
        assert len(body) == 3 + 2 * channels
        if self.refuses:
            self._refused = kind == COMMAND
            if kind == EXCHANGE:
                self._error(BAD_VALUE, kind, sequence, 2)
            return
        enable, *codes = struct.unpack(f"<B{channels}h", body[2:])
        assert enable < 1 << channels
        assert -32768 not in codes
        self._fed_s = time.monotonic()
        if enable == 0:
            self.watchdog_tripped = False
        if not self.watchdog_tripped:
            self._has_command, self._in_force = True, sequence
            for c, code in enumerate(codes):
                self.enabled[c] = bool(enable >> c & 1)
                self.volts[c] = code * self.full_scale_v / 32767 if self.enabled[c] else 0.0
        if kind == EXCHANGE:
            self._state(sequence)

    def _state(self, answers: int) -> None:
        assert self._session is not None
        words, marks = [], []
        for c in range(self._session[0]):
            word = self.status[c] | (4 if self.watchdog_tripped else 0)
            times, count = self.marks[c]
            if times:
                self.marks[c] = (times - 1, count)
                word |= INDEX_LATCHED
                marks.append(count)
            words.append(word)
        self.sample += 1
        flags = (1 if self._has_command else 0) | (2 if self.watchdog_tripped else 0)
        flags |= 4 if self._refused else 0
        self._refused = False
        body = state_body(
            self._number(), self.sample, self.counts[: self._session[0]], answers,
            self._in_force if self._has_command else 0, flags, words, marks,
        )  # fmt: skip
        self._send(body)

    def _error(self, code: int, kind: int, sequence: int, detail: int) -> None:
        self._send(struct.pack("<BBBBBH", ERROR, self._number(), code, kind, sequence, detail))

    def _send(self, body: bytes) -> None:
        if self.delay_s:
            time.sleep(self.delay_s)
        if not self.mute:
            with_faults = self.mangle(framed(body))
            if with_faults:
                os.write(self.master, with_faults)

    def _number(self) -> int:
        self.sequence = (self.sequence + 1) & 255
        return self.sequence


def channels(*numbers: int, counter_bits: int = 32, max_voltage_v: float = 10.0) -> list[Channel]:
    return [Channel(f"axis{n}", n, 1e-6, counter_bits, max_voltage_v) for n in numbers]


def driver_for(
    port: str,
    *numbers: int,
    mode: str = "poll",
    period_s: float = PERIOD_S,
    counter_bits: int = 32,
    **options: Any,
) -> SerialDriver:
    options = {"baud": None, "connect_s": 1.0, **options}
    if mode == "poll" and period_s > 1e-3:
        options.setdefault("wait_s", 0.9 * period_s)
    checked = SerialOptions(port=port, mode=mode, **options)
    return SerialDriver(
        checked, channels(*(numbers or (0, 1)), counter_bits=counter_bits), period_s
    )


class Rig:
    """A driver with its arrays."""

    def __init__(self, box: Box, driver: SerialDriver) -> None:
        self.box, self.driver = box, driver
        self.inputs = Inputs(len(driver.channels))
        self.outputs = Outputs(len(driver.channels))

    def read(self) -> tuple[list[int], list[int]]:
        """Return counts and status words."""
        self.driver.read(self.inputs)
        return self.inputs.counts.tolist(), self.inputs.status.tolist()

    def write(self, *volts: float, enable: int | tuple[int, ...] = 1) -> None:
        self.outputs.volts[:] = volts
        self.outputs.enable[:] = enable
        self.driver.write(self.outputs)

    def read_fresh(self, tries: int = 50) -> tuple[list[int], list[int]]:
        """Read until something new has come: threads of one process may be slow to take turns."""
        for _ in range(tries):
            counts, status = self.read()
            if not status[0] & 0x100:
                return counts, status
            time.sleep(2e-3)
        raise AssertionError("no fresh sample")


def until(condition: Callable[[], bool], timeout_s: float = 2.0) -> None:
    """Wait for what another thread does."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not happen"
        time.sleep(1e-3)


@contextmanager
def box_running(**settings: Any) -> Iterator[Box]:
    box = Box(**settings)
    try:
        box.start()
        yield box
    finally:
        box.end()


@contextmanager
def rig_open(*numbers: int, box: dict[str, Any] | None = None, **options: Any) -> Iterator[Rig]:
    """A box and a driver that has opened it."""
    with box_running(**(box or {})) as device:
        driver = driver_for(device.port, *numbers, **options)
        driver.open()
        try:
            yield Rig(device, driver)
        finally:
            driver.close()
