"""Real-time priority for the kernel's threads that carry the bytes of pseudo-terminals.

They have ordinary priority, whatever both ends have, so any busy program delays a byte by
milliseconds; a wire does not do that. This file is a program of its own, which ends and puts
everything back when its standard input is closed, also where its parent was killed.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from motorctl.errors import RunError

PRIORITY = 75
"""Between the device, for which they work, and the loop with its usual priority of 80."""
LOOK_PERIOD_S = 0.25
"""The kernel starts new ones as it needs them."""
WORKERS = "kworker/u"
"""Those that are bound to no CPU; the layer of terminals hands its work to them."""
READY, REFUSED, NONE = b"raised\n", b"refused\n", b"none\n"
WHY = {
    REFUSED: "that takes root and CAP_SYS_NICE",
    NONE: "/proc shows none, as in a container",
}


@cache
def can_be_prompt() -> bool:
    """Tell whether the workers can be raised here, by doing it."""
    try:
        with prompt_ptys():
            return True
    except RunError:
        return False


@contextmanager
def prompt_ptys() -> Iterator[None]:
    """Keep the workers raised. Raises RunError where that is not possible."""
    process = subprocess.Popen(
        [sys.executable, "-P", __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        said = process.stdout.readline()
        if said != READY:
            why = WHY.get(said, "it failed")
            raise RunError(
                "--raise-workers: the kernel's threads that carry pseudo-terminals cannot be "
                f"given a real-time priority: {why}"
            )
        yield
    finally:
        process.stdin.close()
        process.wait()
        process.stdout.close()


def _raise(raised: dict[int, tuple[int, int]]) -> bytes:
    """Raise the workers that have ordinary priority, and note what they had."""
    answer = NONE
    for pid in _workers():
        with suppress(ProcessLookupError):
            answer = READY
            policy = os.sched_getscheduler(pid)
            if policy != os.SCHED_OTHER:
                continue  # raised by another device, or by the machine's owner
            nice = os.getpriority(os.PRIO_PROCESS, pid)
            try:
                os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
            except PermissionError:
                return REFUSED
            raised[pid] = policy, nice
    return answer


def _workers() -> Iterator[int]:
    for comm in Path("/proc").glob("[0-9]*/comm"):
        with suppress(FileNotFoundError, ProcessLookupError):
            if comm.read_text().startswith(WORKERS):
                yield int(comm.parent.name)


def _put_back(raised: dict[int, tuple[int, int]]) -> None:
    for pid in _workers():
        if pid not in raised:
            continue
        policy, nice = raised[pid]
        with suppress(OSError):
            if os.sched_getscheduler(pid) == os.SCHED_FIFO:
                os.sched_setscheduler(pid, policy, os.sched_param(0))
                os.setpriority(os.PRIO_PROCESS, pid, nice)


def main() -> None:
    """Keep the workers raised until standard input ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # a service manager sends them to all at once
    raised: dict[int, tuple[int, int]] = {}
    try:
        answer = _raise(raised)
        sys.stdout.buffer.write(answer)
        sys.stdout.buffer.flush()
        if answer != READY:
            return
        while not select.select([sys.stdin], [], [], LOOK_PERIOD_S)[0]:
            _raise(raised)
    finally:
        _put_back(raised)


if __name__ == "__main__":
    main()
