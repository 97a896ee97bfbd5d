"""Notes each pause of one CPU until it or its starter is ended.

`python pause_watch.py CPU FILE PRIORITY NAP_S` with a real-time priority above those of the loop
and the devices: nothing that a test starts may keep it waiting, so what it finds is what the
computer itself took away, by its firmware or by the host of a virtual machine. With priority 0 it
waits like any other work of that CPU, the kernel's own included, which hands over what loopback
carries: behind the loops of tests beside, that may stand still for longer than a bus is waited for.
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
ORDINARY = 0
NAP_S = 1e-3
SHORTEST = 2
"""Shorter ones, in naps, are not worth noting."""
NOTE = struct.Struct("dd")
"""When a pause ended, on the monotonic clock, and how long it was, in seconds."""
NOTES = 4096
"""The oldest ones are written over."""
MCL_CURRENT, MCL_FUTURE = 1, 2


def main() -> None:
    """Watch one CPU."""
    cpu, path, priority, starter = int(sys.argv[1]), sys.argv[2], int(sys.argv[3]), os.getppid()
    nap_s = float(sys.argv[4])
    os.sched_setaffinity(0, {cpu})
    if priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    with Path(path).open("r+b") as file:
        notes = mmap.mmap(file.fileno(), NOTE.size * NOTES)
    ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE)
    noted, last_s = 0, time.monotonic()
    while os.getppid() == starter:
        time.sleep(nap_s)
        now_s = time.monotonic()
        if now_s - last_s - nap_s > SHORTEST * nap_s:
            NOTE.pack_into(notes, NOTE.size * (noted % NOTES), now_s, now_s - last_s - nap_s)
            noted += 1
        last_s = now_s


if __name__ == "__main__":
    main()
