"""Virtual time: how much faster than the clock a machine is simulated, its log included."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from motorctl.config import load
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl.log import LogWriter
from motorctl.loop import VirtualMachine

CONFIG = "published_gantry"
SPANS = 20
SPAN_S = 1.0
REAL_TIME_TARGET = Target("ratio", ">=", 15.0)


def virtual_figures(progress: Progress) -> tuple[list[Figure], list[str]]:
    """Simulate the gantry as `motorctl simulate` does; return figures and notes."""
    machine = load(CONFIG)
    ticks = round(SPAN_S * machine.rate_hz)
    axes = log_axes(machine)
    wall_s, cpu_s = np.empty(SPANS), np.empty(SPANS)
    with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
        writer = LogWriter(Path(folder) / "bench.parquet", log_metadata(machine), axes)
        with VirtualMachine(machine, writer.append) as virtual:
            virtual.start()
            virtual.follow_programs(machine.followed_programs)
            virtual.advance(ticks)
            for k in range(SPANS):
                wall, cpu = time.perf_counter(), time.process_time()
                virtual.advance(ticks)
                wall_s[k] = time.perf_counter() - wall
                cpu_s[k] = time.process_time() - cpu
                virtual.raise_faults()
                progress((k + 1) / SPANS)
        writer.close()
    figures = [
        _figure("virtual_time", "virtual time, by the clock", SPAN_S / wall_s),
        _figure("virtual_time_processor", "virtual time, by processor time", SPAN_S / cpu_s),
    ]
    notes = [
        f"Virtual time: {len(axes)} axes of {CONFIG}, every row into a log as `simulate` does; "
        f"medians over {SPANS} spans of {SPAN_S:g} s. Processor time is what an otherwise idle "
        "machine would take."
    ]
    return figures, notes


def _figure(name: str, title: str, times: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Figure:
    value = float(np.median(times))
    return Figure(
        name=name,
        title=title,
        value=value,
        unit="s/s",
        peer="real time",
        peer_value=1.0,
        ratio=value,
        target=REAL_TIME_TARGET,
    )
