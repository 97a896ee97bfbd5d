"""The socket or port that pymodbus opened, used directly: nothing here waits or raises."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import termios
from abc import ABC, abstractmethod
from typing import Final

SENT: Final = 1
BUSY: Final = 0
LOST: Final = -1

UNACKNOWLEDGED_MS: Final = 1000
"""The kernel gives a connection up when what was sent is not acknowledged for so long."""


class Line(ABC):
    """A file descriptor that is asked before it is read, so that an empty one is no exception."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)

    def send(self, frame: bytearray) -> int:
        """Send a whole frame: SENT, BUSY where there was no room for it, or LOST."""
        try:
            size = os.write(self._descriptor, frame)
        except BlockingIOError:
            return BUSY
        except OSError:
            return LOST
        return SENT if size == len(frame) else self._cut_short()

    def receive(self, into: memoryview) -> int:
        """Take what is there: the number of bytes, 0 where there are none, or LOST."""
        try:
            if not self._poll.poll(0):
                return 0
            # Readable and yet empty means that the other end is gone.
            return os.readv(self._descriptor, (into,)) or LOST
        except BlockingIOError:
            return 0
        except OSError:
            return LOST

    def wait(self, time_s: float) -> None:
        """Wait until something can be received; for `safe` only, never in a tick."""
        with contextlib.suppress(OSError):
            self._poll.poll(time_s * 1e3)

    def forget(self) -> None:  # noqa: B027 (on a stream every byte belongs to a reply)
        """Throw away what was received and not yet taken."""

    @abstractmethod
    def _cut_short(self) -> int:
        """Say what a frame means that was sent in part: SENT or LOST."""


class TcpLine(Line):
    """A connected socket."""

    def __init__(self, connection: socket.socket) -> None:
        # Nagle's algorithm would hold a request back until the one before is acknowledged.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
        connection.setblocking(False)
        super().__init__(connection.fileno())

    def _cut_short(self) -> int:
        return LOST  # half a frame on the stream: every later one would be misread


class RtuLine(Line):
    """An open serial port."""

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        super().__init__(descriptor)

    def forget(self) -> None:
        """Throw away what was received and not yet taken."""
        with contextlib.suppress(OSError, termios.error):
            termios.tcflush(self._descriptor, termios.TCIFLUSH)

    def _cut_short(self) -> int:
        return SENT  # the device refuses half a frame by its checksum, and nothing answers
