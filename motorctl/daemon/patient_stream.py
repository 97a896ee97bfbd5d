"""Lines for a terminal or a journal that may not read them: whoever tells something never waits."""

from __future__ import annotations

import logging
import os
import queue
import select
import threading
import time

MOST_LINES = 1000
"""Messages that wait to be written. Fewer: a burst is cut short that a slow terminal would have
taken. More: memory for what nobody reads. By hand: a start with everything wrong has a hundred."""
FLUSH_S = 2.0
"""How long the end waits for a reader [s]. Shorter: last words are lost where the journal is busy;
longer: a stopped terminal holds up the restart by as much. By hand."""


class PatientHandler(logging.Handler):
    """Has a thread of its own write to a file descriptor; where that is full, messages are dropped.

    How many were is told once there is somebody who reads again.

    Parameters
    ----------
    descriptor
        Where to; it is not closed.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__()
        self._descriptor = descriptor
        self._lines: queue.Queue[bytes | None] = queue.Queue(MOST_LINES)
        self._dropped = 0
        self._thread: threading.Thread | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Put a message in line."""
        try:
            line = (self.format(record) + "\n").encode(errors="backslashreplace")
        except Exception:  # as of every handler: the words are at fault, not who says them
            self.handleError(record)
            return
        if self._thread is None:  # not before: the process may be copied until it says something
            self._thread = threading.Thread(target=self._write_all, name="journal", daemon=True)
            self._thread.start()
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self._dropped += 1

    def close(self) -> None:
        """Write what is left, as far as somebody reads it in time."""
        thread, self._thread = self._thread, None
        if thread is not None:
            deadline = time.monotonic() + FLUSH_S
            try:
                self._lines.put(None, timeout=FLUSH_S)
            except queue.Full:
                pass
            else:
                thread.join(max(deadline - time.monotonic(), 0.0))
        super().close()

    def _write_all(self) -> None:
        while (line := self._lines.get()) is not None:
            self._write(line)
            if self._dropped and self._lines.empty():
                dropped, self._dropped = self._dropped, 0
                told = f"motorctl: {dropped} messages are missing here: nobody read them in time\n"
                self._write(told.encode())

    def _write(self, line: bytes) -> None:
        # Not through sys.stderr: whoever waits in there keeps Python from ending.
        while line:
            try:
                line = line[os.write(self._descriptor, line) :]
            except BlockingIOError:
                select.select([], [self._descriptor], [])
            except OSError:  # nobody is there any more
                return
