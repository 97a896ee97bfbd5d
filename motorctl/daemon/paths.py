"""Where the daemon's socket and its state are kept."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

SOCKET_NAME = "motorctl.sock"
SYSTEM_SOCKET = Path("/run/motorctl") / SOCKET_NAME


def daemon_socket() -> Path:
    """Return the socket that a daemon of this user serves unless told otherwise."""
    if directory := os.environ.get("RUNTIME_DIRECTORY"):  # set by systemd
        return Path(directory.split(":")[0]) / SOCKET_NAME
    if os.geteuid() == 0:
        return SYSTEM_SOCKET
    if directory := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(directory) / SOCKET_NAME
    return Path(tempfile.gettempdir()) / f"motorctl-{os.geteuid()}" / SOCKET_NAME


def client_socket() -> Path:
    """Return the socket that a command asks: the user's own daemon if there is one, else root's."""
    own = daemon_socket()
    return own if own.exists() or not SYSTEM_SOCKET.exists() else SYSTEM_SOCKET


def state_file(machine: str) -> Path:
    """Return the file that keeps what a machine has learned."""
    if directory := os.environ.get("STATE_DIRECTORY"):  # set by systemd
        folder = Path(directory.split(":")[0])
    else:
        base = os.environ.get("XDG_STATE_HOME")
        folder = (Path(base) if base else Path.home() / ".local" / "state") / "motorctl"
    return folder / f"{machine}.json"
