"""Who only looks at a machine leaves the CPU of its loop alone."""

from __future__ import annotations

import os
from contextlib import suppress
from functools import cache
from pathlib import Path

from motorctl.api.connection import connect
from motorctl.errors import MotorctlError

TASKS = Path("/proc/self/task")
NICER = 5
"""How much nicer than it began: whatever else shares its CPUs goes first."""


def keep_off_the_loop(pid: int) -> None:
    """Leave the CPU of a loop's process to it, where this computer has another.

    All threads of this process do: those that are there, as an affinity and a niceness are a
    thread's own, and those that they begin later. Called anew for the next loop, which may have
    another CPU, they go to the CPUs that this process began with, but those of that loop.
    """
    cpus, niceness = _began_with()
    with suppress(OSError):  # it may be gone; and where it may be asked nothing, nothing is lost
        cpus = (cpus - os.sched_getaffinity(pid)) or cpus
    done: set[int] = set()
    while new := {int(task.name) for task in TASKS.iterdir()} - done:
        for thread in new:  # until a look finds none that another has begun meanwhile
            with suppress(OSError):  # it may have ended
                os.sched_setaffinity(thread, cpus)
                nice = max(niceness + NICER, os.getpriority(os.PRIO_PROCESS, thread))
                os.setpriority(os.PRIO_PROCESS, thread, nice)
        done |= new


def keep_off_the_loop_of(socket: Path) -> None:
    """Leave the CPU of a daemon's loop to it, once that ticks: before it does, it is on none."""
    with suppress(MotorctlError), connect(socket) as machine:  # it may be gone again
        keep_off_the_loop(machine.status().document["loop"]["pid"])


@cache
def _began_with() -> tuple[frozenset[int], int]:
    """Return the CPUs that this process might use before it was kept off any, and its niceness."""
    return frozenset(os.sched_getaffinity(0)), os.getpriority(os.PRIO_PROCESS, 0)
