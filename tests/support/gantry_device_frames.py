"""CAN layouts for tests of the gantry behind CAN, and frames taken apart bit by bit."""

from __future__ import annotations

import time
from typing import Any

import can

SYNC_ID, COMMAND_ID, STATE_ID = 0x80, 0x200, 0x180

FRAMES: dict[str, Any] = {
    "command": {
        "id": COMMAND_ID,
        "direction": "command",
        "length": 8,
        "signals": {
            "vx": {"means": "volts", "axis": "x", "start": 0, "bits": 16, "signed": True}
            | {"scale": 0.0005},
            "vy": {"means": "volts", "axis": "y", "start": 16, "bits": 16, "signed": True}
            | {"scale": 0.0005},
            "ex": {"means": "enable", "axis": "x", "start": 32, "bits": 1},
            "ey": {"means": "enable", "axis": "y", "start": 33, "bits": 1},
            "dog": {"means": "watchdog", "start": 40, "bits": 8, "scale": 0.001},
            "seq": {"means": "sequence", "start": 56, "bits": 8},
        },
    },
    "state": {
        "id": STATE_ID,
        "direction": "state",
        "length": 8,
        "signals": {
            "cx": {"means": "counts", "axis": "x", "start": 0, "bits": 24, "signed": True},
            "cy": {"means": "counts", "axis": "y", "start": 24, "bits": 24, "signed": True},
            "fault": {"means": "amplifier_fault", "start": 48, "bits": 1},
            "chain": {"means": "estop", "start": 49, "bits": 1, "inverted": True},
            "boot": {"means": "boot", "start": 52, "bits": 4},
            "seq": {"means": "sequence", "start": 56, "bits": 8},
        },
    },
}
CHANNELS = [
    {"axis": axis, "resolution_m": 0.5e-6, "counter_bits": 24, "max_voltage_v": 10.0}
    for axis in ("x", "y")
]
DBC = """VERSION ""
BU_: host device
BO_ 512 Command: 6 host
 SG_ VoltsX : 7|16@0- (0.0005,0) [-16.384|16.3835] "V" device
 SG_ VoltsY : 23|16@0- (0.0005,0) [-16.384|16.3835] "V" device
 SG_ EnableX : 32|1@1+ (1,0) [0|1] "" device
 SG_ EnableY : 33|1@1+ (1,0) [0|1] "" device
 SG_ Sequence : 40|8@1+ (1,0) [0|255] "" device
BO_ 384 Positions: 8 device
 SG_ CountX : 7|24@0- (1,0) [0|0] "" host
 SG_ CountY : 24|24@1- (1,0) [0|0] "" host
 SG_ ChainClosed : 48|1@1+ (1,0) [0|1] "" host
 SG_ Sequence : 56|8@1+ (1,0) [0|255] "" host
"""
DBC_SIGNALS: dict[str, Any] = {
    "x": {"volts": "Command.VoltsX", "enable": "Command.EnableX", "counts": "Positions.CountX"},
    "y": {"volts": "Command.VoltsY", "enable": "Command.EnableY", "counts": "Positions.CountY"},
    "all": {
        "sequence": ["Command.Sequence", "Positions.Sequence"],
        "estop": {"signal": "Positions.ChainClosed", "inverted": True},
    },
}


class CanPeer:
    """A host on a bus."""

    def __init__(self, bus: can.BusABC, fd: bool = False) -> None:
        self.bus, self._fd = bus, fd
        self._sequence = 0

    def __enter__(self) -> CanPeer:
        return self

    def __exit__(self, *_: object) -> None:
        self.bus.shutdown()

    def send(self, identifier: int, data: bytes, extended: bool = False) -> None:
        """Send a frame."""
        message = can.Message(
            arbitration_id=identifier, data=data, is_extended_id=extended, is_fd=self._fd
        )
        self.bus.send(message)

    def command(self, x: float, y: float, enable: int = 3, watchdog_ms: int = 250) -> None:
        """Send the command frame of FRAMES."""
        codes = [round(level / 0.0005) & 0xFFFF for level in (x, y)]
        word = codes[0] | codes[1] << 16 | enable << 32 | watchdog_ms << 40
        word |= self._sequence << 56
        self._sequence = (self._sequence + 1) % 256
        self.send(COMMAND_ID, word.to_bytes(8, "little"))

    def sync(self) -> None:
        """Ask for a sample."""
        self.send(SYNC_ID, b"")

    def frame(self, timeout_s: float = 0.5) -> can.Message | None:
        """Return the next frame, None where none comes."""
        end = time.monotonic() + timeout_s
        while (left := end - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message is not None:
                return message
        return None

    def state(self, timeout_s: float = 0.5) -> dict[str, Any]:
        """Return the next state frame of FRAMES. Raises TimeoutError."""
        while True:
            message = self.frame(timeout_s)
            if message is None:
                raise TimeoutError
            if message.arbitration_id == STATE_ID and len(message.data) == 8:
                return state_of(bytes(message.data))

    def sample(self) -> dict[str, Any]:
        """Send SYNC and give the answer."""
        self.sync()
        return self.state()


def state_of(data: bytes) -> dict[str, Any]:
    """Take the state frame of FRAMES apart."""
    word = int.from_bytes(data, "little")
    counts = []
    for shift in (0, 24):
        raw = word >> shift & 0xFFFFFF
        counts.append(raw - (1 << 24) if raw >> 23 else raw)
    return {
        "counts": counts,
        "fault": word >> 48 & 1,
        "chain": word >> 49 & 1,
        "boot": word >> 52 & 15,
        "sequence": word >> 56,
    }
