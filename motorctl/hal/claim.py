"""One program at a time: a device that obeys everybody would be driven by two."""

from __future__ import annotations

import errno
import socket
from collections.abc import Iterable

from motorctl.errors import RunError


class Claim:
    """Outputs of a device that this program drives and no other of this machine may.

    They are claimed by their names until `release`; the kernel releases those of a process that
    died. Raises RunError where another program has one of them.
    """

    def __init__(self, device: str, outputs: Iterable[str]) -> None:
        self._held: list[socket.socket] = []
        for output in outputs:
            one = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._held.append(one)
            try:
                one.bind(f"\0motorctl {device} {output}")
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
