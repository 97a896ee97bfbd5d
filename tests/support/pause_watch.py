"""Notes each pause of one CPU until it or its starter is ended: `python pause_watch.py CPU FILE`.

Nothing that a test starts may keep this process waiting: it has a higher real-time priority than
the loop and the devices. What it finds is what the computer itself took away, by its firmware or
by the host of a virtual machine.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import struct
import sys
import time
from pathlib import Path

PRIORITY = 98
NAP_S = 1e-3
SHORTEST_S = 2e-3
"""Shorter ones are not worth noting."""
NOTE = struct.Struct("dd")
"""When a pause ended, on the monotonic clock, and how long it was, in seconds."""
NOTES = 4096
"""The oldest ones are written over."""
MCL_CURRENT, MCL_FUTURE = 1, 2


def main() -> None:
    """Watch one CPU."""
    cpu, path, starter = int(sys.argv[1]), sys.argv[2], os.getppid()
    os.sched_setaffinity(0, {cpu})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    with Path(path).open("r+b") as file:
        notes = mmap.mmap(file.fileno(), NOTE.size * NOTES)
    ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE)
    noted, last_s = 0, time.monotonic()
    while os.getppid() == starter:
        time.sleep(NAP_S)
        now_s = time.monotonic()
        if now_s - last_s - NAP_S > SHORTEST_S:
            NOTE.pack_into(notes, NOTE.size * (noted % NOTES), now_s, now_s - last_s - NAP_S)
            noted += 1
        last_s = now_s


if __name__ == "__main__":
    main()
