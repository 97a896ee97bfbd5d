"""Notice what touches a device: sockets, device files, other programs."""

from __future__ import annotations

import os
import stat
import sys
import threading
from collections.abc import Callable
from typing import Any

HARMLESS = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom", "/dev/tty")
SOCKET_EVENTS = (
    "socket.__new__",
    "socket.bind",
    "socket.connect",
    "socket.getaddrinfo",
    "socket.gethostbyname",
    "socket.sendto",
    "socket.sendmsg",
)
PROGRAM_EVENTS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "pty.spawn")

# An audit hook can never be taken out again, so there is one, which mostly does nothing.
_watched_thread: int | None = None
_seen: list[str] = []
_installed = False


def touched_by(action: Callable[[], object]) -> list[str]:
    """Do something and list what it touched of the world of devices, in this thread.

    Ordinary files are left out: options may name a file that describes the layout.
    """
    global _installed, _watched_thread  # noqa: PLW0603
    if not _installed:
        sys.addaudithook(_hook)
        _installed = True
    _seen.clear()
    _watched_thread = threading.get_ident()
    try:
        action()
    finally:
        _watched_thread = None
    return list(_seen)


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if _watched_thread is None or _watched_thread != threading.get_ident():
        return
    if event in SOCKET_EVENTS or event in PROGRAM_EVENTS:
        _seen.append(event)
    elif event == "open" and _is_device(arguments[0]):
        _seen.append(f"open {arguments[0]}")


def _is_device(path: Any) -> bool:
    if not isinstance(path, str | bytes | os.PathLike) or os.fsdecode(path) in HARMLESS:
        return False
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116
    except (OSError, ValueError):
        return os.fsdecode(path).startswith("/dev/")
    return stat.S_ISCHR(mode) or stat.S_ISBLK(mode) or stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)
