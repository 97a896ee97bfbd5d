"""A small slcan adapter on a pty, with a device behind it that answers SYNC.

Written from the protocol alone: lines of ASCII that end with CR. ``Sn`` sets the bit rate, ``O``
opens, ``C`` closes; ``tiiil`` and two hex digits a byte is a frame, ``Tiiiiiiiil`` one of 29 bits,
``b``/``B`` one of CAN FD with a rate switch. CR answers a command, ``z``/``Z`` and CR a frame, BEL
is a refusal.
"""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Callable

import real_time

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


class SlcanPeer:
    """`answer` gives identifier and data of the frames that follow SYNC number k."""

    def __init__(self, answer: Callable[[int], list[tuple[int, bytes]]], sync: int = 0x80) -> None:
        self.master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.frames: list[tuple[int, bytes]] = []
        self.orders: list[str] = []
        self.samples = 0
        self.is_open = False
        self.fd = False
        self._answer, self._sync = answer, sync
        self._stop = threading.Event()
        real_time.begins()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> SlcanPeer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Vanish, as a USB adapter does."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        os.close(self.master)
        os.close(self._slave)

    def say(self, text: bytes) -> None:
        os.write(self.master, text)

    def _serve(self) -> None:
        waiting = b""
        while not self._stop.is_set():
            if not select.select([self.master], [], [], 0.02)[0]:
                continue
            waiting += os.read(self.master, 4096)
            *lines, waiting = waiting.split(b"\r")
            for line in lines:
                self.say(self._obey(line.decode()))

    def _obey(self, line: str) -> bytes:
        kind = line[:1]
        if kind not in ("t", "T", "b", "B"):
            self.orders.append(line)
            if kind in ("O", "C"):
                self.is_open = kind == "O"
            return b"\r" if kind in ("", "S", "Y", "O", "C", "V", "N") else b"\a"
        if not self.is_open:
            return b"\a"
        self.fd = kind in "bB"
        digits = 3 if kind in "tb" else 8
        identifier, length = int(line[1 : 1 + digits], 16), int(line[1 + digits], 16)
        data = bytes.fromhex(line[2 + digits :])
        if len(data) != FD_LENGTHS[length]:
            return b"\a"
        self.frames.append((identifier, data))
        said = b"z\r" if digits == 3 else b"Z\r"
        if identifier != self._sync:
            return said
        self.samples += 1
        return said + b"".join(self.line(*frame) for frame in self._answer(self.samples))

    def line(self, identifier: int, data: bytes) -> bytes:
        length = FD_LENGTHS.index(len(data))
        kind = "b" if self.fd else "t"
        return f"{kind}{identifier:03X}{length:X}{data.hex().upper()}\r".encode()
