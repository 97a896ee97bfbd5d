"""A pseudo-terminal whose slave side looks to the host like the device's serial port."""

from __future__ import annotations

import contextlib
import errno
import os
import tty
from pathlib import Path

from motorctl.errors import RunError

READ_AT_MOST = 65536
TERMINALS = Path("/dev/pts")


class PtyPort:
    """The device's end of a serial line, raw and never blocking.

    `link`, if given, is a symbolic link to the host's end, in place of one to an older
    pseudo-terminal, and follows it where the port is plugged in again. The host's end is kept
    open here too, so that a host that comes and goes is no hang-up.
    """

    def __init__(self, link: Path | None) -> None:
        self._link = link
        self._master = self._slave = -1
        self.path = ""

    def open(self) -> None:
        """Make the port and the link. Raises RunError."""
        try:
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.path = os.ttyname(self._slave)
        except OSError as error:
            raise RunError(f"no pseudo-terminal can be had: {error.strerror}") from error
        if self._link is None:
            return
        try:
            _remove_old(self._link)
            self._link.symlink_to(self.path)
        except OSError as error:
            self.close()
            raise RunError(f"--link {self._link}: {error.strerror}") from error

    def close(self) -> None:
        """Take the port and the link away; the host sees a port that is gone."""
        if self._link is not None and self._link.is_symlink():
            with contextlib.suppress(OSError):
                if str(self._link.readlink()) == self.path:
                    self._link.unlink()
        for number in (self._slave, self._master):
            if number >= 0:
                os.close(number)
        self._master = self._slave = -1

    def fileno(self) -> int:
        """Return the file descriptor to wait on, -1 where the port is unplugged."""
        return self._master

    def read(self) -> bytes:
        """Return the bytes received, perhaps none."""
        try:
            return os.read(self._master, READ_AT_MOST)
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Send, and lose what a host that does not read leaves no room for."""
        with contextlib.suppress(OSError):
            os.write(self._master, data)


def _remove_old(link: Path) -> None:
    """Remove what an earlier run left. Raises OSError for a link that no port made."""
    if not link.is_symlink():
        return
    target = link.readlink()
    if target.parent != TERMINALS:
        raise FileExistsError(
            errno.EEXIST,
            f"points to {target}, which is no pseudo-terminal under {TERMINALS}: "
            "remove it, or give another path",
        )
    link.unlink()
