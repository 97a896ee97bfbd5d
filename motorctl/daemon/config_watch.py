"""See whether the configuration's file is still what a running daemon has read.

A running loop never changes. Whoever edits the file should be told so by the daemon, and not by a
surprise at the next start.
"""

from __future__ import annotations

import hashlib
import logging
import threading
from pathlib import Path

PERIOD_S = 2.0

_log = logging.getLogger("motorctl")


class ConfigWatch:
    """Looks at the file every now and then, in a thread of its own: its disk may hang.

    Parameters
    ----------
    source
        The file that was read.
    """

    def __init__(self, source: Path) -> None:
        self.difference: str | None = None
        """What became of the file since it was read, such as "was removed"; None: nothing."""
        self._source = source
        self._read = _digest(source)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="config-watch", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def end(self) -> None:
        """Watch no longer; waits for no disk."""
        self._ending.set()

    def look(self) -> None:
        """Compare the file with what was read, and tell what is new."""
        now = _digest(self._source)
        difference = None if now == self._read else _words(now)
        if difference == self.difference:
            return
        self.difference = difference
        if difference is None:
            _log.info("%s is again what this daemon runs", self._source)
        else:
            _log.warning(
                "%s %s since it was read: the machine goes on as it was configured then; a "
                "restart takes what is there",
                self._source,
                difference,
            )

    def _run(self) -> None:
        while not self._ending.wait(PERIOD_S):
            self.look()


def _digest(source: Path) -> bytes | str:
    """Return a digest of the file, or in words why there is none."""
    try:
        return hashlib.sha256(source.read_bytes()).digest()
    except FileNotFoundError:
        return "was removed"
    except OSError as error:
        return f"can no longer be read ({error.strerror})"


def _words(digest: bytes | str) -> str:
    return digest if isinstance(digest, str) else "was changed"
