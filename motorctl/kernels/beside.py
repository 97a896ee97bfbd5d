"""A process that compiles beside this one, for as long as this one wants it to.

What it has done it leaves in the cache of kernels, where this process finds it when it gets there.
Nothing that happens to it matters: this one compiles what it does not find.
"""

from __future__ import annotations

import ctypes
import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress

LOOK_S = 0.01
PR_SET_PDEATHSIG = 1
"""From <linux/prctl.h>."""


class CompilingBeside:
    """A copy of this process that does some work and ends.

    It must be made while this process has one thread.

    Parameters
    ----------
    work
        What it does; what this raises is told by the process that needs what was to be done.
    """

    def __init__(self, work: Callable[[], None]) -> None:
        self._pid: int | None = None
        with suppress(OSError):  # a limit on processes or memory: nothing is done beside
            self._pid = os.fork()
        if self._pid == 0:
            _work_and_end(work)

    def wait(self, at_most_s: float) -> None:
        """Return when it has ended, or after so long [s]."""
        deadline = time.monotonic() + at_most_s
        while self._pid is not None and time.monotonic() < deadline:
            if os.waitid(os.P_PID, self._pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
                return
            time.sleep(LOOK_S)

    def end(self) -> None:
        """End it, wherever it is; it may be called again."""
        if self._pid is not None:
            os.kill(self._pid, signal.SIGKILL)  # harmless where it has ended: nobody has waited
            os.waitpid(self._pid, 0)
            self._pid = None


def _work_and_end(work: Callable[[], None]) -> None:
    try:
        # It must not outlive whom it works for: it has inherited what that one holds open.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)  # the other process tells
        with suppress(Exception):
            work()
    finally:
        os._exit(0)
