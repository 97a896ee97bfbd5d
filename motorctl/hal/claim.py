"""One program at a time: a device that obeys everybody would be driven by two."""

from __future__ import annotations

import errno
import hashlib
import socket
from collections.abc import Iterable

from motorctl.errors import RunError

MOST_BYTES = 107
"""Of the kernel's names for sockets, after the zero."""


class Claim:
    """Outputs of a device that this program drives and no other of this machine may.

    They are claimed by their names until `release`; the kernel releases those of a process that
    died. Raises RunError where another program has one of them.
    """

    def __init__(self, device: str, outputs: Iterable[str]) -> None:
        self._held: list[socket.socket] = []
        for output in outputs:
            name = f"motorctl {device} {output}".encode(errors="surrogateescape")
            if len(name) > MOST_BYTES:
                name = b"motorctl " + hashlib.sha256(name).hexdigest().encode()
            try:
                one = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
                self._held.append(one)
                one.bind(b"\0" + name)
            except OSError as error:
                self.release()
                if error.errno != errno.EADDRINUSE:
                    return  # without such names there is no claim, but a device that works
                raise RunError(
                    f"{device}: its {output} is driven by another program on this machine"
                ) from error

    def release(self) -> None:
        """Let others have them."""
        for one in self._held:
            one.close()
        self._held.clear()
