"""Pauses of this computer while a test by the wall clock runs.

A pause looks just like the faults that such tests order. It is measured apart, by processes that
nothing of a test can keep waiting; a failure with a pause in it judges nothing, and the test is
begun anew. On a computer without pauses none is.
"""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import pause_watch

TOO_LONG_S = 5e-3
"""A pause that tests may take for a fault: 25 ticks of a loop at 5 kHz."""
ANEW = 2
"""How often a test with such a pause in it is begun anew."""

_began_s = [0.0]


def begin() -> None:
    """Begin to look: a test starts."""
    _watched()
    _began_s[0] = time.monotonic()


def was_interrupted(error: BaseException | None) -> bool:
    """Tell whether the computer paused for too long in a test that failed, and say so."""
    if error is None:
        return False
    notes = (n for file in _watched() for n in pause_watch.NOTE.iter_unpack(file.read_bytes()))
    longest_s = max((pause_s for ended_s, pause_s in notes if ended_s > _began_s[0]), default=0.0)
    if longest_s < TOO_LONG_S:
        return False
    sys.stderr.write(f"this computer paused for {longest_s * 1e3:.1f} ms during the test\n")
    return True


@cache
def _watched() -> tuple[Path, ...]:
    """Have every CPU watched until this process ends; give where its pauses are noted.

    Without the right to a real-time priority nothing can be told apart, and nothing is.
    """
    usual = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(pause_watch.PRIORITY))
    except OSError:
        return ()
    os.sched_setscheduler(0, *usual)
    folder = Path(tempfile.mkdtemp(prefix="pauses-"))
    atexit.register(shutil.rmtree, folder)
    script = str(Path(pause_watch.__file__))
    files = tuple(folder / str(cpu) for cpu in sorted(os.sched_getaffinity(0)))
    for file in files:
        file.write_bytes(bytes(pause_watch.NOTE.size * pause_watch.NOTES))
        watch = subprocess.Popen([sys.executable, "-S", "-E", script, file.name, str(file)])
        atexit.register(watch.kill)
    return files
