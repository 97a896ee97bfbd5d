"""Devices that run in a thread, and raw peers that speak to them without any driver."""

from __future__ import annotations

import os
import select
import socket
import struct
import termios
import threading
import time
import tty
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import real_time
import yaml

from motorctl_devices import Device, load_device

CHANNEL = {"resolution_m": 0.5e-6, "counter_bits": 32, "max_voltage_v": 10.0}
STATUS_WORD, SEQUENCE_IN, BOOT_WORD = 8, 9, 10


def modbus_channel(number: int) -> dict[str, Any]:
    """Return the registers of one of two channels."""
    names = ("encoder_lost", "amplifier_fault", "limit_negative", "limit_positive")
    flags = {name: {"address": 8, "bit": 6 * number + k} for k, name in enumerate(names)}
    return {
        "volts": {"address": number, "volts_per_count": 10.0 / 32767},
        "enable": {"address": 2, "bit": number},
        "counts": {"address": 2 * number, "bits": 32},
        "status": flags,
    }


MODBUS = {
    "output_base": 0x0800,
    "channels": {0: modbus_channel(0), 1: modbus_channel(1)},
    "sequence": {"output": 3, "input": SEQUENCE_IN},
    "boot_id": {"address": BOOT_WORD},
}


def device_data(serve: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    """Return the content of a device file with two channels."""
    data = {
        "gantry": {"preset": "published_gantry_clean"},
        "channels": [dict(CHANNEL, axis="x"), dict(CHANNEL, axis="y")],
        "rate_hz": 5000,
        "watchdog_s": 0.5,
        "serve": dict(serve),
    }
    return data | changes


def write_device(folder: Path, data: Mapping[str, Any]) -> Path:
    """Write a device file."""
    path = folder / "device.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


@contextmanager
def running(folder: Path, data: Mapping[str, Any], link: Path | None = None) -> Iterator[Device]:
    """Run the device of this content in a thread."""
    device = load_device(write_device(folder, data), link)
    device.open()
    failed: list[BaseException] = []

    def run() -> None:
        try:
            device.run()
        except BaseException as error:
            failed.append(error)

    real_time.begins()
    thread = threading.Thread(target=run, name="device", daemon=True)
    thread.start()
    try:
        yield device
    finally:
        device.stop()
        thread.join(10)
        device.close()
    assert not failed, failed


def until(true: Any, timeout_s: float = 3.0) -> None:
    """Wait for something to become true."""
    end = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.002)


class TcpPeer:
    """A Modbus TCP client of a few lines."""

    def __init__(self, address: str, timeout_s: float = 0.3) -> None:
        host, port = address.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), 2.0)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(timeout_s)
        self.transaction = 0
        self._buffer = b""

    def __enter__(self) -> TcpPeer:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, pdu: bytes, unit: int = 1) -> int:
        """Send a request; gives its transaction."""
        self.transaction = self.transaction % 65535 + 1
        self.socket.sendall(struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, unit) + pdu)
        return self.transaction

    def receive(self) -> tuple[int, bytes]:
        """Return transaction and PDU of the next answer. Raises TimeoutError."""
        while len(self._buffer) < 6 or len(self._buffer) < 6 + self._length():
            came = self.socket.recv(4096)
            if not came:
                raise ConnectionResetError
            self._buffer += came
        end = 6 + self._length()
        adu, self._buffer = self._buffer[:end], self._buffer[end:]
        return struct.unpack(">H", adu[:2])[0], adu[7:]

    def ask(self, pdu: bytes) -> bytes:
        """Return the answer to a request."""
        sent = self.send(pdu)
        number, answer = self.receive()
        assert number == sent
        return answer

    def exchange(
        self, volts: tuple[float, float], enable: int = 3, sequence: int = 1
    ) -> dict[str, Any]:
        """Write commands and read the state in one exchange."""
        return state_of(self.ask(exchange_pdu(volts, enable, sequence)))

    def _length(self) -> int:
        return int(struct.unpack(">H", self._buffer[4:6])[0])


def exchange_pdu(volts: tuple[float, float], enable: int = 3, sequence: int = 1) -> bytes:
    """Return the request of function 23 for the registers of MODBUS."""
    codes = [round(level * 32767 / 10.0) for level in volts]
    return struct.pack(">BHHHHBhhHH", 23, 0, 11, 0x0800, 4, 8, *codes, enable, sequence)


def state_of(pdu: bytes) -> dict[str, Any]:
    """Take the answer of `exchange_pdu` apart."""
    assert pdu[0] == 23, pdu.hex()
    assert pdu[1] == 22
    x, y, _, _, status, sequence, boot = struct.unpack(">iiiiHHH", pdu[2:])
    return {"counts": (x, y), "status": status, "sequence": sequence, "boot": boot}


def modbus_crc(data: bytes) -> int:
    """Compute the checksum of RTU bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


class RawPort:
    """The host's end of a serial line."""

    def __init__(self, path: str | Path) -> None:
        self.number = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.number, termios.TCSANOW)  # what came before is kept
        self._buffer = b""

    def __enter__(self) -> RawPort:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.number)

    def write(self, data: bytes) -> None:
        """Send."""
        os.write(self.number, data)

    def read(self, timeout_s: float = 0.3) -> bytes:
        """Return what comes within the time, nothing where nothing does."""
        if not select.select([self.number], [], [], timeout_s)[0]:
            return b""
        return os.read(self.number, 65536)

    def read_until(self, end: bytes, timeout_s: float = 0.3) -> bytes:
        """Return what comes up to and with `end`. Raises TimeoutError."""
        while end not in self._buffer:
            came = self.read(timeout_s)
            if not came:
                raise TimeoutError
            self._buffer += came
        first, _, self._buffer = self._buffer.partition(end)
        return first + end

    def read_bytes(self, count: int, timeout_s: float = 0.3) -> bytes:
        """Return so many bytes. Raises TimeoutError."""
        while len(self._buffer) < count:
            came = self.read(timeout_s)
            if not came:
                raise TimeoutError
            self._buffer += came
        first, self._buffer = self._buffer[:count], self._buffer[count:]
        return first


def crc16(data: bytes) -> int:
    """Compute the serial protocol's checksum bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


def to_wire(body: bytes) -> bytes:
    """Encode a frame of the serial protocol, a byte at a time."""
    framed = body + struct.pack("<H", crc16(body))
    out, code_at, code = bytearray(1), 0, 1
    for byte in framed:
        if byte:
            out.append(byte)
            code += 1
        if not byte:
            out[code_at] = code
            code_at, code = len(out), 1
            out.append(0)
    out[code_at] = code
    return bytes(out) + b"\0"


def from_wire(wire: bytes) -> bytes | None:
    """Decode what ends with 00; None where it is no frame."""
    data, out, place = wire[:-1], bytearray(), 0
    while place < len(data):
        end = place + data[place]
        if end > len(data):
            return None
        out += data[place + 1 : end]
        if end < len(data):
            out.append(0)
        place = end
    if len(out) < 4 or crc16(bytes(out[:-2])) != struct.unpack("<H", out[-2:])[0]:
        return None
    return bytes(out[:-2])


class SerialPeer(RawPort):
    """A host of the serial protocol of a few lines."""

    def __init__(self, path: str | Path) -> None:
        super().__init__(path)
        self.number_sent = 0
        self.boot_id = 0

    def send(self, kind: int, fields: bytes = b"", number: int | None = None) -> int:
        """Send a frame; gives its number."""
        self.number_sent = (self.number_sent + 1) % 256 if number is None else number
        self.write(to_wire(bytes((kind, self.number_sent)) + fields))
        return self.number_sent

    def receive(self, timeout_s: float = 0.3) -> bytes:
        """Return the next good frame's body. Raises TimeoutError."""
        end = time.monotonic() + timeout_s
        while (left := end - time.monotonic()) > 0:
            body = from_wire(self.read_until(b"\0", left))
            if body is not None:
                return body
        raise TimeoutError

    def hello(
        self, mode: int = 1, watchdog_ms: int = 500, period_us: int = 1000, channels: int = 2
    ) -> bytes:
        """Begin a session; gives the answer to HELLO, without what came before it."""
        fields = struct.pack("<BBBBHI", 1, channels, mode, 0, watchdog_ms, period_us)
        sent = self.send(1, fields)
        while True:
            body = self.receive()
            answers = body[4] if body[0] == 0x81 else body[4] if body[0] == 0x83 else None
            if answers == sent:
                return body

    def command(self, volts: tuple[float, ...], enable: int = 3, kind: int = 2) -> int:
        """Send COMMAND, or EXCHANGE (3)."""
        codes = [round(level * 32767 / 10.0) for level in volts]
        return self.send(kind, struct.pack(f"<B{len(codes)}h", enable, *codes))

    def state(self, timeout_s: float = 0.3) -> dict[str, Any]:
        """Return the next STATE. Raises TimeoutError."""
        while True:
            body = self.receive(timeout_s)
            if body[0] == 0x82:
                return serial_state(body)

    def poll(self) -> dict[str, Any]:
        """Ask for a STATE and give it."""
        sent = self.send(4)
        while True:
            state = self.state()
            if state["answers"] == sent:
                return state


def serial_state(body: bytes, channels: int = 2) -> dict[str, Any]:
    """Take a STATE apart."""
    _, number, answers, in_force, flags, sample = struct.unpack_from("<BBBBBH", body)
    status, counts = [], []
    for channel in range(channels):
        word, count = struct.unpack_from("<Bi", body, 7 + 5 * channel)
        status.append(word)
        counts.append(count)
    marks = struct.unpack(f"<{(len(body) - 7 - 5 * channels) // 4}i", body[7 + 5 * channels :])
    return {
        "number": number,
        "answers": answers,
        "in_force": in_force,
        "flags": flags,
        "sample": sample,
        "status": status,
        "counts": counts,
        "index": marks,
    }
