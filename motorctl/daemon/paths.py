"""Where the daemon's socket and its state are kept."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.state_folder import state_folder

SOCKET_NAME = "motorctl.sock"
SYSTEM_FOLDER = Path("/run/motorctl")
"""Holds root's own socket, and a folder for each gantry that runs as a service."""
SYSTEM_SOCKET = SYSTEM_FOLDER / SOCKET_NAME


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
    """Return the socket that a command asks: the user's own daemon, else root's, else a service's.

    Raises UsageError where several services run and no other daemon does.
    """
    own = daemon_socket()
    for path in (own, SYSTEM_SOCKET):
        if path.exists():
            return path
    services = sorted(SYSTEM_FOLDER.glob(f"*/{SOCKET_NAME}"))
    if len(services) > 1:
        named = ", ".join(map(str, services))
        raise UsageError(f"several gantries run here: choose one with --socket: {named}")
    return services[0] if services else own


def state_file(machine: str) -> Path:
    """Return the file that keeps what a machine has learned."""
    return state_folder() / f"{machine}.json"


def run_file(machine: str) -> Path:
    """Return the file that says what became of a machine's last run."""
    return state_folder() / "runs" / f"{machine}.json"
