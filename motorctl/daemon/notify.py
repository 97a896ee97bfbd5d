"""Tell systemd how the service is doing (protocol of sd_notify(3))."""

from __future__ import annotations

import os
import socket


class ServiceNotifier:
    """Sends states to the service manager; does nothing where none listens."""

    def __init__(self) -> None:
        self._address = os.environ.get("NOTIFY_SOCKET", "")
        if self._address.startswith("@"):  # an abstract address
            self._address = "\0" + self._address[1:]
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)

    def ready(self, status: str) -> None:
        """Say that start-up is complete."""
        self._send("READY=1", f"STATUS={status}")

    def status(self, text: str) -> None:
        """Say in one line what the service does."""
        self._send(f"STATUS={text}")

    def alive(self) -> None:
        """Feed the watchdog; called for observed progress only."""
        self._send("WATCHDOG=1")

    def stopping(self, status: str) -> None:
        """Say that the service is ending."""
        self._send("STOPPING=1", f"STATUS={status}")

    def needs_time(self, seconds: float) -> None:
        """Ask for more time to start or stop, counted from now.

        The watchdog is not fed: that would set it up again for a service that is stopping.
        """
        self._send(f"EXTEND_TIMEOUT_USEC={round(seconds * 1e6)}")

    def close(self) -> None:
        """Release the socket."""
        if self._socket is not None:
            self._socket.close()

    def _send(self, *lines: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto("\n".join(lines).encode(), self._address)
        except OSError:
            return  # a deaf service manager is no reason to stop a machine
