"""Drivers prepared in a process of their own while the tick is compiled: a first start waits less.

Both compile kernels, which takes seconds and one CPU each. What the child compiles it leaves in the
cache of kernels, where this process finds it when it prepares its own drivers.
"""

from __future__ import annotations

import ctypes
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from motorctl.config.machine import Machine
from motorctl.loop.tick import make_drivers

LATER_S = 20.0
"""How long the child may take longer than what is done meanwhile [s]: it compiles less than a tick
is, so it waits for a CPU or hangs. Longer keeps a start from a driver that hangs there; shorter
compiles twice. By hand."""
LOOK_S = 0.01
PR_SET_PDEATHSIG = 1
"""From <linux/prctl.h>."""


@contextmanager
def prepared_beside(machine: Machine) -> Iterator[None]:
    """Let another process prepare the machine's drivers until the context ends.

    It must be entered while this process has one thread. Nothing that happens to the other process
    matters, as this one prepares its drivers all the same: it finds less in the cache.

    Parameters
    ----------
    machine
        Whose drivers are to be prepared.

    Yields
    ------
    None
        The other process is gone when the context is left.
    """
    child = _fork()
    if child == 0:
        _prepare(machine)
    try:
        yield
        if child is not None:
            _wait_for(child)
    finally:
        if child is not None:
            _end(child)


def _fork() -> int | None:
    try:
        return os.fork()
    except OSError:  # a limit on processes or memory: nothing is prepared beside
        return None


def _prepare(machine: Machine) -> None:
    """Prepare and end the process, whatever happens."""
    try:
        # Whoever kills the loop has killed this, too: it holds the control socket's lock.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)  # the other process tells
        for driver in make_drivers(machine).values():
            with suppress(Exception):  # told by the process that needs it
                driver.prepare()
    finally:
        os._exit(0)


def _wait_for(child: int) -> None:
    deadline = time.monotonic() + LATER_S
    while time.monotonic() < deadline:
        if os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            return
        time.sleep(LOOK_S)


def _end(child: int) -> None:
    os.kill(child, signal.SIGKILL)  # harmless where it has ended: nobody has waited for it yet
    os.waitpid(child, 0)
