"""The CAN buses that the device can be on: python-can's, and a serial line with an adapter."""

from __future__ import annotations

import contextlib
import os
import threading
from abc import ABC, abstractmethod
from collections import deque
from pathlib import Path
from typing import Any, NamedTuple

import can

from motorctl.errors import RunError
from motorctl_devices.pty_port import PtyPort

DRAIN_AT_ONCE = 64
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


class Frame(NamedTuple):
    """One data frame."""

    identifier: int
    data: bytes
    extended: bool = False
    fd: bool = False


class CanBus(ABC):
    """Frames in and out, without waiting."""

    @property
    @abstractmethod
    def address(self) -> str:
        """Where a host finds the bus."""

    @abstractmethod
    def open(self) -> None:
        """Get on the bus. Raises RunError."""

    @abstractmethod
    def close(self) -> None:
        """Leave the bus."""

    @abstractmethod
    def fileno(self) -> int:
        """Return the file descriptor to wait on, -1 where there is none."""

    @abstractmethod
    def receive(self) -> list[Frame]:
        """Return the frames received."""

    @abstractmethod
    def send(self, frame: Frame) -> None:
        """Send a frame, or count that there was no room."""


class LibraryBus(CanBus):
    """A bus of python-can: socketcan, udp_multicast, virtual."""

    def __init__(self, interface: str, channel: str, **settings: Any) -> None:
        self._interface, self._channel = interface, channel
        self._settings = settings
        self._bus: can.BusABC | None = None
        self._pump: _Pump | None = None
        self._number = -1

    @property
    def address(self) -> str:
        """Return interface and channel."""
        return f"{self._interface} {self._channel}"

    def open(self) -> None:
        """Get on the bus. Raises RunError."""
        try:
            self._bus = can.Bus(interface=self._interface, channel=self._channel, **self._settings)
        except Exception as error:  # each interface fails in its own way
            raise RunError(f"CAN {self.address}: {type(error).__name__}: {error}") from error
        try:
            self._number = self._bus.fileno()
        except NotImplementedError:
            self._number = -1
        if self._number < 0:
            self._pump = _Pump(self._bus)
            self._number = self._pump.fileno()

    def close(self) -> None:
        """Leave the bus."""
        if self._pump is not None:
            self._pump.close()
            self._pump = None
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None
        self._number = -1

    def fileno(self) -> int:
        """Return the file descriptor to wait on."""
        return self._number

    def receive(self) -> list[Frame]:
        """Return the frames received."""
        frames: list[Frame] = []
        bus = self._bus
        if bus is None:
            return frames
        for _ in range(DRAIN_AT_ONCE):
            message = self._pump.take() if self._pump else _receive(bus)
            if message is None:
                break
            if message.is_error_frame or message.is_remote_frame:
                continue
            frames.append(
                Frame(
                    message.arbitration_id,
                    bytes(message.data),
                    message.is_extended_id,
                    message.is_fd,
                )
            )
        return frames

    def send(self, frame: Frame) -> None:
        """Send a frame, or count that there was no room."""
        message = can.Message(
            arbitration_id=frame.identifier,
            data=frame.data,
            is_extended_id=frame.extended,
            is_fd=frame.fd,
            bitrate_switch=frame.fd,
        )
        with contextlib.suppress(can.CanError):  # there was no room for it
            if self._bus is not None:
                self._bus.send(message, timeout=0)


def _receive(bus: can.BusABC) -> can.Message | None:
    try:
        return bus.recv(0)
    except (can.CanError, OSError, ValueError):
        return None


class _Pump:
    """Make a bus that cannot be waited on one that can, with a thread and a pipe."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._frames: deque[can.Message] = deque(maxlen=4096)
        self._out, self._in = os.pipe()
        os.set_blocking(self._out, False)
        os.set_blocking(self._in, False)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="can-pump", daemon=True)
        self._thread.start()

    def fileno(self) -> int:
        return self._out

    def take(self) -> can.Message | None:
        with contextlib.suppress(OSError):
            os.read(self._out, 4096)
        try:
            message = self._frames.popleft()
        except IndexError:
            return None
        if self._frames:
            self._ring()
        return message

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        os.close(self._out)
        os.close(self._in)

    def _ring(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(self._in, b"\0")

    def _run(self) -> None:
        while not self._ended.is_set():
            message = self._bus.recv(0.02)
            if message is not None:
                self._frames.append(message)
                self._ring()


class SlcanAdapter(CanBus):
    """The other end of python-can's `slcan`: an adapter on a serial line, and a bus behind it.

    It speaks the LAWICEL text protocol: commands end with a carriage return, `t` and `T` are
    frames with 11 and 29 identifier bits, `d`, `D`, `b` and `B` those of CAN FD. Like the common
    firmware of such adapters it does not acknowledge frames that the host sends.
    """

    LONGEST_LINE = 1 + 8 + 1 + 128

    def __init__(self, link: Path | None) -> None:
        self._port = PtyPort(link)
        self._line = bytearray()
        self._on_bus = False
        self.refused = 0
        """Lines that were no command."""

    @property
    def address(self) -> str:
        """Return the path of the serial port."""
        return f"slcan {self._port.path}"

    @property
    def path(self) -> str:
        """Return the path of the serial port."""
        return self._port.path

    def open(self) -> None:
        """Make the serial port. Raises RunError."""
        self._line.clear()
        self._on_bus = False
        self._port.open()

    def close(self) -> None:
        """Take the serial port away."""
        self._port.close()

    def fileno(self) -> int:
        """Return the file descriptor to wait on."""
        return self._port.fileno()

    def receive(self) -> list[Frame]:
        """Answer the adapter's commands; return the frames that the host sends."""
        frames: list[Frame] = []
        *lines, rest = (bytes(self._line) + self._port.read()).split(b"\r")
        self._line[:] = rest[-self.LONGEST_LINE :]
        for line in lines:
            try:
                frame = self._obey(line)
            except (ValueError, IndexError):
                self.refused += 1
                self._port.write(b"\a")
                continue
            if frame is not None and self._on_bus:
                frames.append(frame)
        return frames

    def send(self, frame: Frame) -> None:
        """Tell the host of a frame on the bus."""
        if not self._on_bus:
            return
        letter = "b" if frame.fd else "t"
        place = f"{frame.identifier:03X}"
        if frame.extended:
            letter, place = letter.upper(), f"{frame.identifier:08X}"
        code = FD_LENGTHS.index(len(frame.data))
        self._port.write(f"{letter}{place}{code:X}{frame.data.hex().upper()}\r".encode())

    def _obey(self, line: bytes) -> Frame | None:
        text = line.decode("ascii").lstrip("\n\a")
        if not text:
            return None
        letter = text[0]
        if letter in "tTdDbB":
            extended, fd = letter.isupper(), letter in "dDbB"
            end = 9 if extended else 4
            length = FD_LENGTHS[int(text[end], 16)]
            data = bytes.fromhex(text[end + 1 :])
            if len(data) != length or (length > 8 and not fd):
                raise ValueError(text)
            return Frame(int(text[1:end], 16), data, extended, fd)
        if letter in "OLC":
            self._on_bus = letter != "C"
            self._port.write(b"\r")
        elif letter in "SsYMmZX":
            self._port.write(b"\r")
        elif letter in "VNF":
            self._port.write({"V": b"V1013\r", "N": b"NMCTL\r", "F": b"F00\r"}[letter])
        elif letter not in "rR":  # remote frames ask for nothing here
            raise ValueError(text)
        return None
