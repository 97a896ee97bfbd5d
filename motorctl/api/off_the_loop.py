"""Who only looks at a machine leaves the CPU of its loop alone."""

from __future__ import annotations

import os
from contextlib import suppress


def keep_off_the_loop(pid: int) -> None:
    """Leave the CPU of a loop's process to it, where this computer has another."""
    with suppress(OSError):  # it may be gone; and where it may be asked nothing, nothing is lost
        own, of_loop = os.sched_getaffinity(0), os.sched_getaffinity(pid)
        if own - of_loop:
            os.sched_setaffinity(0, own - of_loop)
    with suppress(OSError):
        os.nice(5)
