"""The socket file of the daemon: one daemon a socket, and who may connect."""

from __future__ import annotations

import array
import errno
import fcntl
import grp
import os
import pwd
import socket
import stat
import struct
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from motorctl.errors import UsageError

SOCKET_MODE = 0o660
FOLDER_MODE = 0o755
"""Of a socket's folder that is made here: whoever may write there could put another daemon's socket
in its place. Members of the socket's group have to get through."""
SO_PEERGROUPS = 59  # Linux 4.13; not among Python's constants
_MOST_GROUPS = 256


class Role(Enum):
    """What somebody who is connected may do."""

    OBSERVE = "observe"
    """Look at the machine, and stop it at once: nobody has to watch an accident."""
    OPERATE = "operate"
    """All commands but those of who may configure."""
    CONFIGURE = "configure"
    """All commands: other models for the machine that runs, too."""

    @property
    def commands(self) -> bool:
        """Whether more than looking and stopping at once is allowed."""
        return self is not Role.OBSERVE


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

    def __init__(
        self,
        path: Path,
        group: str | None = None,
        operators: str | None = None,
        configuration: Path | None = None,
    ) -> None:
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
        configuration
            The file of what runs: of those who may command, whoever may write it may change the
            models that run, too. None: nobody but root and the daemon's user.

        Raises
        ------
        UsageError
            Where a daemon lives there, the path is something else, a group or the place cannot be
            used, or the folder is in the hands of another user, who could put a daemon of their
            own in its place.
        """
        self.path = path
        self.group_id = os.getegid() if group is None else _group_id(group)
        self.operators = operators
        self.configuration = configuration
        self._operators_id = None if operators is None else _group_id(operators)
        try:
            path.parent.mkdir(FOLDER_MODE, parents=True, exist_ok=True)
            _insist_on_own_folder(path.parent)
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
            return Role.CONFIGURE
        if self.group_id not in peer.groups:
            return None
        operates = self._operators_id is None or self._operators_id in peer.groups
        if not operates:
            return Role.OBSERVE
        return Role.CONFIGURE if self._may_write_configuration(peer) else Role.OPERATE

    def _may_write_configuration(self, peer: Peer) -> bool:
        """Tell what owner, group and mode of the file say, as the kernel reads them."""
        if self.configuration is None:
            return False
        try:
            found = self.configuration.stat()
        except OSError:
            return False
        if found.st_uid == peer.uid:
            return bool(found.st_mode & stat.S_IWUSR)
        of_group = found.st_gid in peer.groups
        return bool(found.st_mode & (stat.S_IWGRP if of_group else stat.S_IWOTH))

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


def insist_on_own_server(connection: socket.socket, path: Path) -> None:
    """Raise UsageError unless root or the own user serves at the other end of a connection."""
    uid = peer_of(connection).uid
    if uid not in _own_users():
        raise UsageError(
            f"the daemon on {path} is {_user_name(uid)}'s, not yours: name the socket with "
            "--socket if that is the one you mean"
        )


def _group_id(group: str) -> int:
    try:
        return grp.getgrnam(group).gr_gid
    except KeyError:
        raise UsageError(f"control socket: there is no group '{group}' on this machine") from None


def _insist_on_own_folder(folder: Path) -> None:
    """Raise UsageError where another user rules over what stands in the socket's folder.

    The way there counts, too: who owns a link may let it lead elsewhere.
    """
    for found in (folder.lstat(), folder.stat()):
        if found.st_uid not in _own_users():
            raise UsageError(
                f"control socket: the folder {folder} belongs to {_user_name(found.st_uid)}, who "
                "could answer in the daemon's place; remove it or choose another --socket"
            )
    if found.st_mode & stat.S_IWOTH and not found.st_mode & stat.S_ISVTX:
        raise UsageError(
            f"control socket: everybody may write into the folder {folder}, and could answer in "
            f"the daemon's place: chmod o-w {folder}, or choose another --socket"
        )


def _own_users() -> set[int]:
    return {0, os.geteuid()}


def _user_name(uid: int) -> str:
    try:
        return f"user {pwd.getpwuid(uid).pw_name}"
    except KeyError:
        return f"user {uid}"


def _take_lock(path: Path) -> int:
    """Lock the socket's name for the life of this process; the kernel lets go when it dies.

    What lies there is written over: only if it is a file of our own, under this one name.
    """
    place = path.with_name(path.name + ".lock")
    try:
        lock = os.open(place, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise _not_our_lock(place, "is a link") from error
        raise
    if strange := _strange(os.fstat(lock)):
        os.close(lock)
        raise _not_our_lock(place, strange)
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


def _strange(lock: os.stat_result) -> str:
    """Return why a lock that was there cannot be one of our own; empty: it may be."""
    if not stat.S_ISREG(lock.st_mode):
        return "is no plain file"
    if lock.st_uid not in _own_users():
        return f"belongs to {_user_name(lock.st_uid)}"
    return "has a second name, and holds something else" if lock.st_nlink > 1 else ""


def _not_our_lock(place: Path, why: str) -> UsageError:
    return UsageError(
        f"control socket: the lock {place} {why}, so it is left alone; remove it or choose "
        "another --socket"
    )


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
            _unlink(path)
            return
    raise UsageError(f"a daemon already serves {path}; stop it or choose another --socket")


def _unlink(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(
            f"control socket {path}: what a dead daemon left cannot be removed: {error.strerror}; "
            "remove it or choose another --socket"
        ) from error


def _identity(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.lstat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino, found.st_ctime_ns  # inode numbers are used again
