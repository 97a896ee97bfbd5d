"""Single keys from a person's terminal, while something else is shown."""

from __future__ import annotations

import os
import queue
import re
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

STOP = " "
"""The space bar, the largest key: what it does is done at once, whatever is being shown."""
LEAVE = "q"
ESCAPED = {
    b"\x1b[A": "up",
    b"\x1b[B": "down",
    b"\x1b[C": "right",
    b"\x1b[D": "left",
    b"\x1bOA": "up",
    b"\x1bOB": "down",
    b"\x1bOC": "right",
    b"\x1bOD": "left",
}
"""What terminals send for the keys that move a cursor."""
MOST_BYTES = 4096
_KEY = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]?|O?.?)|.", re.DOTALL)
"""What a key sends: one byte, or an escape sequence, which is none of its own letters."""


class Keys:
    """The keys that are pressed, and whether the one that stops was.

    `ends` are the keys that end something: no later key makes one of them be forgotten.
    """

    def __init__(self, ends: str = LEAVE) -> None:
        self._ends = ends
        self._pressed: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._failure: Exception | None = None
        self.stopped = False
        """Whether the key that stops was pressed, and obeyed."""

    def next(self, timeout_s: float) -> str | None:
        """Return the last key pressed within so long: a character, or up, down, left or right.

        What a key that is held down sent before is dropped, but for the first that ends something.
        None: nothing was pressed. Raises what the emergency stop raised.
        """
        key = None
        try:
            key = self._pressed.get(timeout=timeout_s)
            while key not in self._ends:
                key = self._pressed.get_nowait()
        except queue.Empty:
            pass
        if self._failure is not None:
            raise self._failure
        return key

    def _read(self, terminal: int, end: int, stop: Callable[[], object]) -> None:
        """Read keys until the other end of the pipe `end` is closed."""
        while end not in select.select([terminal, end], [], [])[0]:
            try:
                pressed = os.read(terminal, MOST_BYTES)
            except OSError:  # the terminal is gone, and whoever sat there
                pressed = b""
            if STOP.encode() in pressed:
                try:
                    stop()
                    self.stopped = True
                except Exception as failure:  # told by whoever asks for the next key
                    self._failure = failure
            for key in _keys(pressed):
                self._pressed.put(key)
            if not pressed:
                return  # the terminal is gone


def _keys(pressed: bytes) -> list[str]:
    """Return the keys that sent these bytes: over a slow line several come at once."""
    if not pressed:
        return [LEAVE]
    parts = [part[0] for part in _KEY.finditer(pressed)]
    # Any other key of a terminal is one that means nothing here, but one was pressed.
    return [ESCAPED.get(part, STOP if part.startswith(b"\x1b") else chr(part[0])) for part in parts]


@contextmanager
def single_keys(stop: Callable[[], object], ends: str = LEAVE) -> Iterator[Keys | None]:
    """Yield single keys of the terminal at standard input; None where there is none.

    Parameters
    ----------
    stop
        Called at once where a space is pressed, from another thread.
    ends
        The keys that end something, as of `Keys`.

    Yields
    ------
    Keys or None
        What else is pressed.
    """
    if not (sys.stdin and sys.stdin.isatty()):
        yield None
        return
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    end, begin = os.pipe()
    keys = Keys(ends)
    reader = threading.Thread(target=keys._read, args=(terminal, end, stop), daemon=True)
    try:
        tty.setcbreak(terminal)
        reader.start()
        yield keys
    finally:
        os.close(begin)
        reader.join()
        os.close(end)
        with suppress(termios.error):  # it may be gone
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)
