"""Pauses of this computer while a test by the wall clock runs.

A pause looks just like the faults that such tests order. It is measured apart, by processes that
nothing of a test can keep waiting, and by ones that wait like the kernel's own work of a CPU; a
failure with a pause in it judges nothing, and the test is begun anew. On a computer without pauses
none is.
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

TOO_LONG_S = {pause_watch.PRIORITY: 5e-3, pause_watch.ORDINARY: 50e-3}
"""A pause that tests may take for a fault, by the priority of who had to wait: 25 ticks of a loop
at 5 kHz; a third of the silence that trips an axis on a bus."""
TOLD = {
    pause_watch.PRIORITY: "this computer paused for",
    pause_watch.ORDINARY: "ordinary work of a CPU had to wait for",
}
ANEW = 2
"""How often a test with such a pause in it is begun anew."""

_began_s = [0.0]


def watch(
    cpu: int, file: Path, priority: int, nap_s: float = pause_watch.NAP_S
) -> subprocess.Popen[bytes]:
    """Have a CPU watched and its pauses noted in a file, for as long as this process lives."""
    file.write_bytes(bytes(pause_watch.NOTE.size * pause_watch.NOTES))
    told = (str(cpu), str(file), str(priority), str(nap_s))
    return subprocess.Popen([sys.executable, "-S", "-E", pause_watch.__file__, *told])


def noted(file: Path) -> list[tuple[float, float]]:
    """Return when each pause in a file ended, and how long it was [s]."""
    notes = pause_watch.NOTE.iter_unpack(file.read_bytes())
    return [(ended_s, pause_s) for ended_s, pause_s in notes if pause_s]


def begin() -> None:
    """Begin to look: a test starts."""
    _watched()
    _began_s[0] = time.monotonic()


def was_interrupted(error: BaseException | None) -> bool:
    """Tell whether the computer paused for too long in a test that failed, and say so."""
    if error is None:
        return False
    for priority, files in _watched().items():
        longest_s = max(_longest_s(file) for file in files)
        if longest_s >= TOO_LONG_S[priority]:
            sys.stderr.write(f"{TOLD[priority]} {longest_s * 1e3:.1f} ms during the test\n")
            return True
    return False


def _longest_s(file: Path) -> float:
    notes = noted(file)
    return max((pause_s for ended_s, pause_s in notes if ended_s > _began_s[0]), default=0.0)


@cache
def _watched() -> dict[int, tuple[Path, ...]]:
    """Have every CPU watched until this process ends; give where its pauses are noted, by priority.

    Without the right to a real-time priority nothing can be told apart, and nothing is.
    """
    usual = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(pause_watch.PRIORITY))
    except OSError:
        return {}
    os.sched_setscheduler(0, *usual)
    folder = Path(tempfile.mkdtemp(prefix="pauses-"))
    atexit.register(shutil.rmtree, folder)
    return {
        priority: tuple(
            _watch(cpu, priority, folder / f"{cpu}-{priority}")
            for cpu in sorted(os.sched_getaffinity(0))
        )
        for priority in TOO_LONG_S
    }


def _watch(cpu: int, priority: int, file: Path) -> Path:
    atexit.register(watch(cpu, file, priority).kill)
    return file
