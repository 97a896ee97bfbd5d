"""Who only looks leaves the loop's CPU, with every thread that it has or will have."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

LOOKS = """
import json, os, subprocess, sys, threading, time
from motorctl.api.off_the_loop import keep_off_the_loop

began = sorted(os.sched_getaffinity(0))[:2]
os.sched_setaffinity(0, began)
niceness = os.getpriority(os.PRIO_PROCESS, 0)
ends = threading.Event()

def told():
    tasks = sorted(int(name) for name in os.listdir("/proc/self/task"))
    nice = [os.getpriority(os.PRIO_PROCESS, task) - niceness for task in tasks]
    cpus = [[began.index(cpu) for cpu in sorted(os.sched_getaffinity(task))] for task in tasks]
    return sorted(map(list, set(map(tuple, cpus)))), sorted(set(nice)), len(tasks) > 1

threading.Thread(target=ends.wait).start()
found = [told()]
loop = subprocess.Popen([sys.executable, "-S", "-c", "input()"], stdin=subprocess.PIPE)
for cpus in ([began[0]], [began[1]], began):
    os.sched_setaffinity(loop.pid, cpus)
    asking = threading.Thread(target=keep_off_the_loop, args=(loop.pid,))  # as a request's does
    asking.start()
    asking.join()
    threading.Thread(target=ends.wait).start()
    found.append(told())
loop.communicate(b"\\n")
ends.set()
print(json.dumps(found))
"""


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="this computer has one CPU to use")
def test_every_thread_leaves_the_cpu_of_each_loop_that_there_is_one_after_the_other() -> None:
    told = subprocess.check_output([sys.executable, "-c", LOOKS], timeout=60)
    every_cpu = [[0, 1]]
    assert json.loads(told) == [  # CPUs and nicenesses of all threads, and whether they are several
        [every_cpu, [0], True],
        [[[1]], [5], True],
        [[[0]], [5], True],
        [every_cpu, [5], True],
    ]
