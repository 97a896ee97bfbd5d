"""Real-time priority for the kernel's threads that carry the bytes of pseudo-terminals.

They have ordinary priority, whatever both ends have, so any busy program delays a byte by
milliseconds; a wire does not do that. This file is a program of its own, which ends and puts
everything back when its standard input is closed, also where its parent was killed.
"""

from __future__ import annotations

import os
import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from motorctl.errors import RunError

PRIORITY = 75
"""Between the device, for which they work, and the loop."""
LOOK_PERIOD_S = 0.25
"""The kernel starts new ones as it needs them."""
WORKERS = "kworker/u"
"""Those that are bound to no CPU; the layer of terminals hands its work to them."""
READY = b"raised\n"


@contextmanager
def prompt_ptys() -> Iterator[None]:
    """Keep the workers raised. Raises RunError where that is not allowed."""
    process = subprocess.Popen(
        [sys.executable, "-P", __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        if process.stdout.readline() != READY:
            raise RunError(
                "the kernel's workers cannot be given a real-time priority: that takes root or "
                "CAP_SYS_NICE, and a /proc that shows them"
            )
        yield
    finally:
        process.stdin.close()
        process.wait()
        process.stdout.close()


def _raise(raised: dict[int, tuple[int, int]]) -> bool:
    """Raise the workers that have ordinary priority, and note what they had. False: refused."""
    for comm in Path("/proc").glob("[0-9]*/comm"):
        pid = int(comm.parent.name)
        with suppress(FileNotFoundError, ProcessLookupError):
            if not comm.read_text().startswith(WORKERS):
                continue
            policy = os.sched_getscheduler(pid)
            if policy != os.SCHED_OTHER:
                continue
            try:
                os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
            except PermissionError:
                return False
            raised[pid] = policy, os.getpriority(os.PRIO_PROCESS, pid)
    return bool(raised)


def _put_back(raised: dict[int, tuple[int, int]]) -> None:
    for pid, (policy, nice) in raised.items():
        with suppress(OSError):
            if os.sched_getparam(pid).sched_priority != PRIORITY:
                continue
            os.sched_setscheduler(pid, policy, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, pid, nice)


def main() -> None:
    """Keep the workers raised until standard input ends."""
    raised: dict[int, tuple[int, int]] = {}
    try:
        if not _raise(raised):
            return
        sys.stdout.buffer.write(READY)
        sys.stdout.buffer.flush()
        while not select.select([sys.stdin], [], [], LOOK_PERIOD_S)[0]:
            _raise(raised)
    finally:
        _put_back(raised)


if __name__ == "__main__":
    main()
