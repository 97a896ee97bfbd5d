"""Make a log of a partial file while something more important runs.

``python -m`` this, the file, and the numbers of the CPUs to keep off. The process takes no CPU and,
as the kernel derives one priority from the other, no disk that anybody else wants. It prints what
`recover` returns as JSON; where it cannot, a message, and the exit status is 2.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

EXPENDABLE = "500"
"""When memory is short, the kernel ends this process before the daemon: the partial file stays."""


def command(partial: Path, keep_off: Iterable[int]) -> list[str]:
    """Return what starts the process for one file, off these CPUs."""
    return [sys.executable, "-m", __name__, str(partial), *map(str, sorted(keep_off))]


def step_back(keep_off: frozenset[int]) -> None:
    """Take the lowest priority, and leave CPUs to others; what is refused is done without."""
    # Even at the lowest priority the kernel's own work for this process, and what it leaves of the
    # CPU's cache, delays the loop. Where there is no other CPU, it has to do.
    if others := os.sched_getaffinity(0) - keep_off:
        with suppress(OSError):
            os.sched_setaffinity(0, others)
    with suppress(OSError):
        os.nice(19)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(EXPENDABLE)


def main(partial: Path, keep_off: frozenset[int]) -> int:
    """Make the log; return the exit status."""
    step_back(keep_off)
    # Only now: the threads of what is imported inherit the priority.
    from motorctl.errors import MotorctlError
    from motorctl.log.recovery import recover

    try:
        done = recover(partial)
    except MotorctlError as error:
        print(error, file=sys.stderr)
        return error.exit_status
    print(json.dumps(dataclasses.asdict(done) | {"path": str(done.path)}))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), frozenset(map(int, sys.argv[2:]))))
