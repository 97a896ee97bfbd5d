"""The socket file of the daemon: one daemon a socket, and who may connect."""

from __future__ import annotations

import array
import fcntl
import grp
import os
import socket
import stat
import struct
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from motorctl.errors import UsageError

SOCKET_MODE = 0o660
SO_PEERGROUPS = 59  # Linux 4.13; not among Python's constants
_MOST_GROUPS = 256


class Role(Enum):
    """What somebody who is connected may do."""

    OBSERVE = "observe"
    """Look at the machine, and stop it at once: nobody has to watch an accident."""
    OPERATE = "operate"
    """All commands."""


@dataclass(frozen=True)
class Peer:
    """Who is at the other end, as the kernel tells it."""

    pid: int
    uid: int
    groups: frozenset[int]


class ControlSocket:
    """A bound Unix socket, and the lock that keeps a second daemon from it.

    The lock can be handed to the loop process, so that the machine stays taken until that one
    has ended too.
    """

    def __init__(self, path: Path, group: str | None = None, operators: str | None = None) -> None:
        """Bind `path`, replacing what a dead daemon left.

        Parameters
        ----------
        path
            Of the socket's file.
        group
            Whose members may connect besides root and the daemon's user; None: its own group.
        operators
            The group whose members may command; the others who are connected may only look. None:
            whoever may connect.

        Raises
        ------
        UsageError
            Where a daemon lives there, the path is something else, or a group or the place cannot
            be used.
        """
        self.path = path
        self.group_id = os.getegid() if group is None else _group_id(group)
        self.operators = operators
        self._operators_id = None if operators is None else _group_id(operators)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = _take_lock(path)
        except OSError as error:
            raise UsageError(f"control socket {path}: {error.strerror}") from error
        try:
            _remove_stale(path)
            self.socket = self._bind()
        except BaseException:
            os.close(self._lock)
            raise
        self._identity = _identity(path)

    @property
    def lock_fd(self) -> int:
        """The descriptor whose copies keep a second daemon away."""
        return self._lock

    def role_of(self, peer: Peer) -> Role | None:
        """Return what a peer may do; None: nothing, it is kept out.

        Root and the daemon's own user may do everything, whatever groups they are in.
        """
        if peer.uid in {0, os.geteuid()}:
            return Role.OPERATE
        if self.group_id not in peer.groups:
            return None
        operates = self._operators_id is None or self._operators_id in peer.groups
        return Role.OPERATE if operates else Role.OBSERVE

    def close(self) -> None:
        """Take the socket away, unless somebody has put another in its place."""
        self.socket.close()
        if _identity(self.path) == self._identity:
            self.path.unlink()
        os.close(self._lock)

    def _bind(self) -> socket.socket:
        bound = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        # Nobody may connect between bind and chown.
        before = os.umask(0o177)
        try:
            bound.bind(str(self.path))
        except OSError as error:
            bound.close()
            raise UsageError(f"control socket {self.path}: {error.strerror or error}") from error
        finally:
            os.umask(before)
        try:
            os.chown(self.path, -1, self.group_id)
            self.path.chmod(SOCKET_MODE)
        except OSError as error:
            bound.close()
            self.path.unlink()
            group = grp.getgrgid(self.group_id).gr_name
            raise UsageError(
                f"control socket {self.path}: its group cannot be set to '{group}': "
                f"{error.strerror}"
            ) from error
        bound.setblocking(False)
        return bound


def peer_of(connection: socket.socket) -> Peer:
    """Ask the kernel who connected; raises OSError where it does not tell."""
    size = struct.calcsize("3i")
    raw = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    pid, uid, gid = struct.unpack("3i", raw)
    groups = array.array("I")
    groups.frombytes(connection.getsockopt(socket.SOL_SOCKET, SO_PEERGROUPS, 4 * _MOST_GROUPS))
    return Peer(pid, uid, frozenset(groups) | {gid})


def _group_id(group: str) -> int:
    try:
        return grp.getgrnam(group).gr_gid
    except KeyError:
        raise UsageError(f"control socket: there is no group '{group}' on this machine") from None


def _take_lock(path: Path) -> int:
    """Lock the socket's name for the life of this process; the kernel lets go when it dies."""
    lock = os.open(
        path.with_name(path.name + ".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600
    )
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        owner = os.read(lock, 32).decode(errors="replace").strip()
        os.close(lock)
        raise UsageError(
            f"a daemon already serves {path} (process {owner or '?'}); stop it or choose another "
            "--socket"
        ) from None
    os.ftruncate(lock, 0)
    os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)
    return lock


def _remove_stale(path: Path) -> None:
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(mode):
        raise UsageError(
            f"control socket {path}: a file that is no socket is there; remove it or choose "
            "another --socket"
        )
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            path.unlink(missing_ok=True)
            return
    raise UsageError(f"a daemon already serves {path}; stop it or choose another --socket")


def _identity(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.lstat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino, found.st_ctime_ns  # inode numbers are used again
