"""Devices on a virtual CAN bus, written from docs/drivers/can.md alone."""

from __future__ import annotations

import struct
import time
from collections import deque
from typing import Any

import can
import numpy as np
from served_peer import ServedPeer


class Peer(ServedPeer):
    """A device of two channels in a thread; what a layout changes is in the subclasses."""

    FD = False
    SYNC_ID: int | None = None
    COMMAND_ID = 0x200
    VOLTS_STEP = 0.0005

    def __init__(self, channel: str, period_s: float) -> None:
        self.period_s = period_s
        self.boot, self.sequence = 3, 250
        self.counts, self.volts, self.enabled = [0, 0], np.zeros(2), np.zeros(2, bool)
        self.silent = False
        self.faults: deque[np.random.Generator | None] = deque()
        """What becomes of the next samples: None is lost, a generator damages."""
        self._bus = can.Bus(interface="virtual", channel=channel, receive_own_messages=False)
        self.begin_serving()

    def end(self) -> None:
        if self.end_serving():
            self._bus.shutdown()

    def restart(self) -> None:
        self.boot = (self.boot + 1) % 16
        self.sequence = 77
        self.counts, self.volts, self.enabled = [0, 0], np.zeros(2), np.zeros(2, bool)

    def go_off_the_bus(self) -> None:
        """Let the host's controller say that it went bus-off, as Linux tells it."""
        self.silent = True
        self._bus.send(can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8)))

    def _run(self) -> None:
        due = time.monotonic()
        while self._running:
            if self.SYNC_ID is None:
                due += self.period_s
                message = self._bus.recv(max(0.0, due - time.monotonic()))
                while message is not None:
                    self._take(message)
                    message = self._bus.recv(max(0.0, due - time.monotonic()))
                due = max(due, time.monotonic() - self.period_s)
                self._sample()
                continue
            message = self._bus.recv(0.05)
            if message is None:
                continue
            if message.arbitration_id == self.SYNC_ID:
                self._sample()
            else:
                self._take(message)

    def _take(self, message: can.Message) -> None:
        if message.arbitration_id == self.COMMAND_ID and not message.is_error_frame:
            *codes, enable = struct.unpack_from("<hhB", message.data)
            self.enabled = np.array([enable & 1, enable >> 1 & 1], bool)
            self.volts = np.array(codes) * self.VOLTS_STEP

    def _sample(self) -> None:
        self.sequence = (self.sequence + 1) % 256
        if self.silent:
            return
        fault = self.faults.popleft() if self.faults else False
        if fault is None:
            return
        late = fault is not False and fault.random() < 0.5
        sequence = (self.sequence - int(fault.integers(10, 100))) % 256 if late else self.sequence
        for identifier, whole in self._frames(sequence):
            resized = fault is not False and not late
            data = self._resized(whole, fault) if resized else whole
            self._bus.send(
                can.Message(
                    arbitration_id=identifier,
                    is_extended_id=False,
                    is_fd=self.FD,
                    bitrate_switch=self.FD,
                    data=data,
                )
            )

    def _frames(self, sequence: int) -> list[tuple[int, bytes]]:
        raise NotImplementedError

    def _resized(self, data: bytes, random: np.random.Generator) -> bytes:
        raise NotImplementedError


class FdPeer(Peer):
    """The page's complete example: CAN FD, sampled on SYNC, one state frame of 12 bytes."""

    FD = True
    SYNC_ID = 0x80

    def _frames(self, sequence: int) -> list[tuple[int, bytes]]:
        data = struct.pack("<iiBBBB", *self.counts, 0, 1 | self.boot << 4, sequence, 0)
        return [(0x180, data)]

    def _resized(self, data: bytes, random: np.random.Generator) -> bytes:
        size = (0, 4, 8, 16, 20, 64)[random.integers(6)]
        return data.ljust(size, b"\0")[:size]


class ClassicPeer(Peer):
    """Classic CAN, free-running, a state frame an axis, Motorola byte order, 16-bit counters."""

    def _frames(self, sequence: int) -> list[tuple[int, bytes]]:
        return [
            (0x180 + i, struct.pack(">hBB", count, self.boot << 4, sequence))
            for i, count in enumerate(self.counts)
        ]

    def _resized(self, data: bytes, random: np.random.Generator) -> bytes:
        size = (0, 1, 2, 3, 5, 8)[random.integers(6)]
        return data.ljust(size, b"\0")[:size]


def _signal(means: str, start: int, bits: int, **more: Any) -> dict[str, Any]:
    return {"means": means, "start": start, "bits": bits, **more}


def _command(length: int) -> dict[str, Any]:
    signals = {
        "volts_x": _signal("volts", 0, 16, axis="x", signed=True, scale=0.0005),
        "volts_y": _signal("volts", 16, 16, axis="y", signed=True, scale=0.0005),
        "enable_x": _signal("enable", 32, 1, axis="x"),
        "enable_y": _signal("enable", 33, 1, axis="y"),
        "sequence": _signal("sequence", (length - 1) * 8, 8),
    }
    return {"id": 0x200, "direction": "command", "length": length, "signals": signals}


def fd_options(channel: str) -> dict[str, Any]:
    """Return the options for FdPeer."""
    command = _command(8)
    command["signals"]["watchdog"] = _signal("watchdog", 40, 8, scale=0.001)
    flags = ("encoder_lost x", "encoder_lost y", "amplifier_fault x", "amplifier_fault y")
    flags += ("limit_negative x", "limit_positive x", "limit_negative y", "limit_positive y")
    signals = {
        "counts_x": _signal("counts", 0, 32, axis="x", signed=True),
        "counts_y": _signal("counts", 32, 32, axis="y", signed=True),
        "chain": _signal("estop", 72, 1, inverted=True),
        "boot": _signal("boot", 76, 4),
        "sequence": _signal("sequence", 80, 8),
    }
    for i, (means, axis) in enumerate(flag.split() for flag in flags):
        signals[f"{means}_{axis}"] = _signal(means, 64 + i, 1, axis=axis)
    positions = {"id": 0x180, "direction": "state", "length": 12, "signals": signals}
    return {
        "interface": "virtual",
        "channel": channel,
        "bitrate": 1_000_000,
        "fd": True,
        "data_bitrate": 5_000_000,
        "sync": {"id": 0x80, "wait_s": 2e-3},
        "watchdog_s": 0.2,
        "open_timeout_s": 0.5,
        "frames": {"command": command, "positions": positions},
    }


def classic_options(channel: str) -> dict[str, Any]:
    """Return the options for ClassicPeer."""
    frames = {"command": _command(6)}
    for i, axis in enumerate("xy"):
        signals = {
            f"counts_{axis}": _signal("counts", 7, 16, axis=axis, signed=True, byte_order="big"),
            f"boot_{axis}": _signal("boot", 20, 4, axis=axis),
            f"sequence_{axis}": _signal("sequence", 24, 8),
        }
        state = {"id": 0x180 + i, "direction": "state", "length": 4, "signals": signals}
        frames[f"position_{axis}"] = state
    return {
        "interface": "virtual",
        "channel": channel,
        "open_timeout_s": 0.5,
        "frames": frames,
    }
