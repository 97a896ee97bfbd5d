"""A peer of a driver under test that a thread of its own serves, and one on a serial port."""

from __future__ import annotations

import os
import threading
import tty
from abc import ABC, abstractmethod
from pathlib import Path

import real_time


class ServedPeer(ABC):
    """The device's end of a line; a thread runs `_run` from `begin_serving` to `end_serving`."""

    _running = False

    def begin_serving(self) -> None:
        """Serve from now on."""
        self._running = True
        real_time.begins()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def end_serving(self) -> bool:
        """Serve no more; return whether it did."""
        if not self._running:
            return False
        self._running = False
        self._thread.join()
        return True

    @abstractmethod
    def _run(self) -> None:
        """Serve while `_running`."""


class PtyPeer(ServedPeer):
    """The device's end of a pseudo-terminal; `port` is a link that is there while it is."""

    port: Path

    def begin(self) -> None:
        """Make the port, and serve it."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port.symlink_to(os.ttyname(self._slave))
        self.begin_serving()

    def end(self) -> None:
        """Take the port away, if it is there."""
        if self.end_serving():
            self.port.unlink()
            os.close(self._master)
            os.close(self._slave)
