"""See whether the configuration's files are still what a running daemon has read.

A running loop never changes. Whoever edits the file should be told so by the daemon, and not by a
surprise at the next start.
"""

from __future__ import annotations

import hashlib
import logging
import threading
from collections.abc import Iterable
from pathlib import Path

from motorctl.config.machine import Machine

PERIOD_S = 2.0

_log = logging.getLogger("motorctl")


class ConfigWatch:
    """Looks at the files every now and then, in a thread of its own: their disk may hang.

    Parameters
    ----------
    source
        The file that was read.
    named
        Further ones that it names, as `named_files` finds them.
    """

    def __init__(self, source: Path, named: Iterable[Path] = ()) -> None:
        self.difference: str | None = None
        """What became of the file since it was read, such as "was removed"; None: nothing. Of one
        that it names, such as "names points.csv, which was removed"."""
        self._source = source
        self._read = {path: _digest(path) for path in (source, *named)}
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="config-watch", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def end(self) -> None:
        """Watch no longer; waits for no disk."""
        self._ending.set()

    def look(self) -> None:
        """Compare the files with what was read, and tell what is new."""
        difference = self._first_difference()
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

    def _first_difference(self) -> str | None:
        for path, read in self._read.items():
            now = _digest(path)
            if now != read:
                words = _words(now)
                return words if path == self._source else f"names {path}, which {words}"
        return None

    def _run(self) -> None:
        while not self._ending.wait(PERIOD_S):
            self.look()


def named_files(machine: Machine) -> list[Path]:
    """Return the files whose content a configuration takes: points of programs, tables of drivers.

    A device that a driver opens is none.
    """
    programs = machine.programs.values()
    holders = [*programs, *(setup.options for setup in machine.drivers.values())]
    values = (value for held in holders for value in vars(held).values())
    return sorted({value for value in values if isinstance(value, Path) and value.is_file()})


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
