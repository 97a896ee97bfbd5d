"""A peer on a serial port of its own, served by a thread."""

from __future__ import annotations

import os
import threading
import tty
from abc import ABC, abstractmethod
from pathlib import Path

import real_time


class PtyPeer(ABC):
    """The device's end of a pseudo-terminal; `port` is a link that is there while it is."""

    port: Path
    _running = False

    def begin(self) -> None:
        """Make the port, and serve it."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port.symlink_to(os.ttyname(self._slave))
        self._running = True
        real_time.begins()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Take the port away, if it is there."""
        if self._running:
            self._running = False
            self._thread.join()
            self.port.unlink()
            os.close(self._master)
            os.close(self._slave)

    @abstractmethod
    def _run(self) -> None:
        """Serve `_master` while `_running`."""
