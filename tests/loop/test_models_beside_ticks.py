"""Other models are linked beside ticks, and keep them waiting for less than a guard allows."""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from motorctl.config import Machine, load, shipped_config
from motorctl.config.machine import MOST_PARAMETERS
from motorctl.loop import LoopMemory
from motorctl.loop.compile_models import compile_models
from motorctl.loop.process import SWITCH_INTERVAL_S
from motorctl.loop.succession import Succession
from motorctl.loop.tick import Tick
from motorctl.loop.warm_up import Unconnected

LIMIT_S = 0.6e-3
"""Three periods of 5 kHz: so long may a tick of the shipped gantry be late, by its guards."""
NAP_S = 50e-6
LOOP, BESIDE = 80, 79
"""Priorities, as the loop's and its thread's."""

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]


def gantry(folder: Path, lag_s: float | None = None) -> Machine:
    document = yaml.safe_load(shipped_config("published_gantry").read_text())
    document["programs"] = {}
    for axis in document["axes"].values():
        axis["program"] = None
    if lag_s is not None:
        document["axes"]["x"]["model"]["input_lag"] = {"time_s": lag_s}
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(document))
    return load(path)


def run_at(priority: int) -> None:
    cpu = max(os.sched_getaffinity(0))
    thread = threading.get_native_id()
    os.sched_setaffinity(thread, {cpu})
    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))


def longest_wait_s(load_models: Any) -> float:
    """Return how long a thread like the loop's waited at most while models were linked."""
    waits: list[float] = []
    began, ended = threading.Event(), threading.Event()

    def tick() -> None:
        run_at(LOOP)
        began.set()
        while not ended.is_set():
            before_s = time.perf_counter()
            time.sleep(NAP_S)
            waits.append(time.perf_counter() - before_s - NAP_S)

    def link() -> None:
        run_at(BESIDE)
        waits.clear()
        load_models()
        ended.set()

    ticking, linking = threading.Thread(target=tick), threading.Thread(target=link)
    ticking.start()
    began.wait()
    linking.start()
    linking.join()
    ended.set()
    ticking.join()
    return max(waits)


def test_linking_other_models_keeps_a_tick_waiting_for_less_than_its_guard_allows(
    tmp_path: Path,
) -> None:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:
        pytest.skip("no right to a real-time priority: nothing can be told of waiting")
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    machine = gantry(tmp_path)
    interval_s = sys.getswitchinterval()
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    tick = Tick(machine, memory, driver_class=Unconnected)
    # constants that no other test has: nothing of them is linked in this process
    others = [gantry(tmp_path, lag_s) for lag_s in (0.000371, 0.000372, 0.000373)]
    made = [compile_models(machine, other) for other in others]
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        waits_s = [longest_wait_s(lambda m=m: Succession(tick, m)) for m in made]  # type: ignore[misc]
    finally:
        sys.setswitchinterval(interval_s)
        memory.close()
    # what else this computer does may be in one of them
    assert min(waits_s) < LIMIT_S, waits_s
