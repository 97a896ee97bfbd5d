"""A driver and its device in one process, as small as a whole one can be.

The broken drivers of `broken_drivers` differ from it in one thing each.
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from motorctl.hal import (
    Channel,
    Driver,
    DriverOptions,
    Inputs,
    Outputs,
    RateBudget,
    RunError,
    Status,
)
from motorctl.hal.conformance import Received, Rig

FULL_SCALE_V = 12.0
CODES = 32767
WIRES: dict[str, Device] = {}
"""What is at the other end of a port."""


class Device:
    """Answers each command with its counts, by the same wire."""

    def __init__(self, bits: Sequence[int]) -> None:
        self.bits = bits
        self.session = 0
        self.gone = False
        self.inbox: deque[bytes] = deque(maxlen=8)
        self.faults: deque[str | np.random.Generator] = deque()
        self.silent = False
        self.restart()

    def restart(self) -> None:
        self.session += 1
        self.counts = [0] * len(self.bits)
        self.volts = np.zeros(len(self.bits))
        self.enabled = np.zeros(len(self.bits), bool)

    def take(self, command: bytes) -> None:
        if self.gone:
            raise ConnectionResetError("the wire is cut")
        n = len(self.bits)
        *codes, bits = struct.unpack(f"<{n}hB", command)
        self.enabled[:] = [bits >> i & 1 for i in range(n)]
        self.volts[:] = np.array(codes) * FULL_SCALE_V / CODES
        if self.silent:
            return
        body = struct.pack(f"<I{n}i", self.session, *self.counts)
        reply = body + struct.pack("<I", zlib.crc32(body))
        fault = self.faults.popleft() if self.faults else None
        if isinstance(fault, np.random.Generator):
            place = int(fault.integers(len(reply)))
            flipped = reply[place] ^ int(fault.integers(1, 256))
            reply = reply[:place] + bytes([flipped]) + reply[place + 1 :]
        if fault != "lose":
            self.inbox.append(reply)

    def reply(self) -> bytes | None:
        if self.gone:
            raise ConnectionResetError("the wire is cut")
        return self.inbox.popleft() if self.inbox else None


class WireOptions(DriverOptions):
    """Which wire."""

    port: str


class WireDriver(Driver):
    """Sends codes and enables, takes counts; everything that can go wrong has a method."""

    Options: ClassVar[type[DriverOptions]] = WireOptions
    exchange_delay_periods = 1.0

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, WireOptions)
        self.port = options.port
        self.size = len(channels)
        self.device: Device | None = None
        self.session = 0
        self.last = np.zeros(self.size, np.int64)
        self.latched = Status(0)

    def rate_budget(self) -> RateBudget:
        return RateBudget(10_000.0, "no bus; one call in memory takes 100 us")

    def open(self) -> None:
        device = WIRES.get(self.port)
        if device is None or device.gone:
            self.refuse()
        assert device is not None
        device.inbox.clear()
        self.device, self.session, self.latched = device, device.session, Status(0)
        self.zero()

    def refuse(self) -> None:
        raise RunError(f"port {self.port}: no device there")

    def close(self) -> None:
        self.device = None

    def read(self, inputs: Inputs) -> None:
        status, newest = Status(0), None
        try:
            while self.device is not None and (reply := self.device.reply()) is not None:
                counts = self.decode(reply)
                if counts is None:
                    status |= self.corrupt()
                else:
                    newest = counts
        except OSError:
            self.vanished()
        if newest is None:
            status |= self.stale()
        else:
            self.last[:] = newest
        inputs.counts[:] = self.last
        inputs.status[:] = int(status | self.latched)

    def decode(self, reply: bytes) -> Sequence[int] | None:
        if zlib.crc32(reply[:-4]) != int.from_bytes(reply[-4:], "little"):
            return None
        session, *counts = struct.unpack_from(f"<I{self.size}i", reply)
        if session != self.session:
            self.restarted()
        return counts

    def corrupt(self) -> Status:
        return Status.CORRUPT

    def stale(self) -> Status:
        return Status.STALE

    def vanished(self) -> None:
        self.latched |= Status.COMMUNICATION_LOST | Status.BUS_OFF

    def restarted(self) -> None:
        self.latched |= Status.DEVICE_RESTARTED | Status.ENCODER_LOST

    def write(self, outputs: Outputs) -> None:
        codes, bits = [], 0
        for i in range(self.size):
            volts, on = float(outputs.volts[i]), bool(outputs.enable[i])
            on, volts = self.permitted(on, volts)
            codes.append(self.code(volts))
            bits |= on << i
        self.send(codes, bits)

    def permitted(self, on: bool, volts: float) -> tuple[bool, float]:
        good = on and bool(np.isfinite(volts))
        return good, volts if good else 0.0

    def code(self, volts: float) -> int:
        return round(min(max(volts / FULL_SCALE_V, -1.0), 1.0) * CODES)

    def send(self, codes: Sequence[int], bits: int) -> None:
        if self.device is None:
            return
        try:
            self.device.take(struct.pack(f"<{self.size}hB", *codes, bits))
        except OSError:
            self.vanished()

    def zero(self) -> None:
        self.send([0] * self.size, 0)

    def safe(self) -> None:
        if self.device is not None:
            self.zero()
        elif (device := WIRES.get(self.port)) is not None and not device.gone:
            self.device = device
            self.zero()
            self.device = None


class WireRig(Rig):
    """All hooks, at once and without a clock."""

    driver_class = WireDriver
    options: ClassVar = {"port": "wire0"}
    channels = (Channel("x", 0, 0.5e-6, 32, 10.0), Channel("y", 1, 0.5e-6, 16, 5.0))
    period_s = 1e-3
    absent = "wire0"
    volts_tolerance_v = 0.5 * FULL_SCALE_V / CODES + 1e-9
    full_scale_v = FULL_SCALE_V
    exchanges = 1000
    patience_s = 0.0
    safe_s = 0.2

    def stop(self) -> None:
        WIRES.clear()

    def start(self) -> None:
        self.device = WIRES["wire0"] = Device([c.counter_bits for c in self.channels])

    def pass_period(self, driver: Driver) -> None:
        pass

    def move_to(self, counts) -> None:
        self.device.counts = [int(count) for count in counts]

    def received(self) -> Received:
        return Received(self.device.volts.copy(), self.device.enabled.copy())

    def lose_next_reply(self) -> None:
        self.device.faults.append("lose")

    def garble_next_reply(self, random) -> None:
        self.device.faults.append(random)

    def go_silent(self) -> None:
        self.device.silent = True

    def speak_again(self) -> None:
        self.device.silent = False

    def restart(self) -> None:
        self.device.restart()

    def vanish(self) -> None:
        self.device.gone = True

    def come_back(self) -> None:
        self.device.gone = False
        self.device.restart()
