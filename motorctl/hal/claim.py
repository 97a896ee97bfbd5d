"""One program at a time: a device that obeys everybody would be driven by two."""

from __future__ import annotations

import errno
import hashlib
import pwd
import socket
import struct
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from motorctl.errors import RunError
from motorctl.printable import one_line

MOST_BYTES = 107
"""Of the kernel's names for sockets, after the zero."""
MOST_ASKERS = 4096
"""Programs that were refused and have asked who holds it; a program of which more were refused is
no longer named. Larger changes nothing: it is the most that Linux allows unless told otherwise."""
_CREDENTIALS = struct.Struct("3i")


class Claim:
    """Outputs of a device that this program drives and no other of this machine may.

    They are claimed by their names until `release`; the kernel releases those of a process that
    died. Raises RunError where another program has one of them, and names that program.

    Names of sockets belong to no user, so that any of this machine may claim one first: as any may
    send to a bus or a network. A lock in a folder would change nothing: daemons of two users
    exclude each other only if both may open it, and whoever may open a file may lock it.
    """

    def __init__(self, device: str, outputs: Iterable[str]) -> None:
        self._held: list[socket.socket] = []
        for output in outputs:
            name = f"motorctl {device} {output}".encode(errors="surrogateescape")
            if len(name) > MOST_BYTES:
                name = b"motorctl " + hashlib.sha256(name).hexdigest().encode()
            address = b"\0" + name
            try:
                one = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
                self._held.append(one)
                one.bind(address)
                one.listen(MOST_ASKERS)  # nobody is answered, but the kernel tells whose it is
            except OSError as error:
                self.release()
                if error.errno != errno.EADDRINUSE:
                    return  # without such names there is no claim, but a device that works
                raise RunError(
                    f"{device}: its {output} is driven by another program on this machine: "
                    f"{_holder(address)}"
                ) from error

    def release(self) -> None:
        """Let others have them."""
        for one in self._held:
            one.close()
        self._held.clear()


def _holder(address: bytes) -> str:
    """Return who holds a name, as the kernel tells it."""
    size = _CREDENTIALS.size
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
            asking.setblocking(False)
            asking.connect(address)
            told = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    except OSError:
        return "it does not show which; as root, `ss -xap | grep motorctl` does"
    pid, uid, _ = _CREDENTIALS.unpack(told)
    user = f"user {uid}"
    with suppress(KeyError):
        user += f" ({one_line(pwd.getpwuid(uid).pw_name)})"
    if pid <= 0:
        return f"one of {user}, in another container"
    program = ""
    with suppress(OSError):
        program = f" ({one_line(Path(f'/proc/{pid}/comm').read_text(errors='replace').strip())})"
    return f"process {pid}{program} of {user}"
