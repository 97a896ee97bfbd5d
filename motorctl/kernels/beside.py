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

GONE_S = 5.0
"""How long an ended process may take to go [s]: one that a disk holds cannot. Larger keeps a start
waiting, smaller leaves a zombie. By hand."""
LOOK_S = 0.002
PR_SET_PDEATHSIG = 1
"""From <linux/prctl.h>."""


class CompilingBeside:
    """A copy of this process that does some work and ends.

    It has the same priority: on a busy computer one that stands back gets no time, and leaves its
    work to the other one.

    It must be made while no other thread of Python runs. With a single CPU, or where no process can
    be had, nothing is done beside.

    Parameters
    ----------
    work
        What it does; what this raises is told by the process that needs what was to be done. It may
        be ended at any point.
    """

    def __init__(self, work: Callable[[], None]) -> None:
        self._pid: int | None = None
        if len(os.sched_getaffinity(0)) < 2:
            return
        parent = os.getpid()
        with suppress(OSError):  # a limit on processes or memory
            self._pid = os.fork()
        if self._pid == 0:
            _work_and_end(work, parent)

    def end(self) -> None:
        """End it, wherever it is, and wait until it is gone; it may be called again."""
        if self._pid is None:
            return
        pid, self._pid = self._pid, None
        deadline = time.monotonic() + GONE_S
        # A child that nobody has waited for keeps its number; where SIGCHLD is ignored none does.
        with suppress(ChildProcessError):
            if os.waitpid(pid, os.WNOHANG) != (0, 0):
                return
            os.kill(pid, signal.SIGKILL)
            while os.waitpid(pid, os.WNOHANG) == (0, 0) and time.monotonic() < deadline:
                time.sleep(LOOK_S)


def _work_and_end(work: Callable[[], None], parent: int) -> None:
    try:
        # It must not outlive whom it works for: it has inherited what that one holds open.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            return
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)  # the other process tells
        with suppress(Exception):
            work()
    finally:
        os._exit(0)
