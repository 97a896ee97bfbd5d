"""How long a tick waits while other models are linked, in a process like the loop's.

`python linking_waits.py FD COUNT` reads a machine from its standard input, prepares itself as the
loop's process does, says that it is ready, lets the thread beside the loop take COUNT orders from
the pipe FD, and writes the longest wait in each, and how long it took [s], to its standard output.
What a process above the loop's priority had to wait on the same CPU meanwhile is taken away: no
lock of Python can keep that one waiting.
"""

from __future__ import annotations

import os
import pickle
import sys
import tempfile
import time
from pathlib import Path

import pause_watch
import pauses

from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.loop import LoopMemory
from motorctl.loop.model_thread import ModelThread
from motorctl.loop.process import SWITCH_INTERVAL_S
from motorctl.loop.realtime import enter_beside, enter_realtime, usual_priority
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Word
from motorctl.loop.warm_up import Unconnected, warm_up

READY = b"ready for orders\n"
NAP_S = 50e-6
SETTLE_S = 0.1
"""For the watch to begin, and to note its last pause."""


def longest_waits_s(tick: Tick, orders: int, paused: Path) -> list[tuple[float, float]]:
    """Return the longest wait of this thread, which has the loop's priority, and the order's time.

    Pauses of its CPU are noted in the file `paused`.
    """
    memory, number, done = tick.memory, 1, 0
    waits: list[list[tuple[float, float]]] = [[] for _ in range(orders)]
    while done < orders:
        before_s = time.monotonic()
        time.sleep(NAP_S)
        waits[done].append((before_s + NAP_S, time.monotonic()))
        if tick.successor is not None:
            tick = tick.successor(number)
        number += 1
        done = memory.look_at(Word.MODELS_DONE)
        assert not memory.status["models_refused"][0], memory.status["models_told"][0]
    time.sleep(SETTLE_S)
    paused_s = [(ended_s - pause_s, ended_s) for ended_s, pause_s in pauses.noted(paused)]
    return [
        (
            max(until - since - _overlap_s(since, until, paused_s) for since, until in w),
            w[-1][1] - w[0][0],
        )
        for w in waits
    ]


def _overlap_s(since_s: float, until_s: float, pauses: list[tuple[float, float]]) -> float:
    return sum(max(0.0, min(until_s, end) - max(since_s, begin)) for begin, end in pauses)


def main() -> None:
    """Measure."""
    orders_fd, orders = int(sys.argv[1]), int(sys.argv[2])
    machine: Machine = pickle.load(sys.stdin.buffer)
    warm_up(machine)
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    tick = Tick(machine, memory, driver_class=Unconnected)
    tick.prepare()
    enter_realtime(machine.loop)
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    (cpu,) = os.sched_getaffinity(0)
    with tempfile.TemporaryDirectory() as folder:
        paused = Path(folder) / "paused"
        watch = pauses.watch(cpu, paused, pause_watch.PRIORITY, NAP_S)
        time.sleep(SETTLE_S)
        with usual_priority():
            beside = ModelThread(tick, memory, orders_fd).begin()
        enter_beside(beside, machine.loop)
        sys.stdout.buffer.write(READY)
        sys.stdout.flush()
        waits = longest_waits_s(tick, orders, paused)
        watch.kill()
        watch.wait()
    pickle.dump(waits, sys.stdout.buffer)


if __name__ == "__main__":
    main()
