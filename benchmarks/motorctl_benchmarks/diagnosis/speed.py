"""How long a diagnosis takes and how much memory, in processes of its own.

One machine with cogging on one axis and a rich motion of ten minutes, at 5 kHz; shorter recordings
are its beginning. The time is that of reading the log and diagnosing, kernels being compiled
before; memory is the most that was resident.
"""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.identify.columns.measured import read_measured
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.fit.declared_models import declared_models
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.diagnosis.cases import Case, draw_case
from motorctl_benchmarks.diagnosis.configuration import with_motion
from motorctl_benchmarks.diagnosis.motions import DURATION_S
from motorctl_benchmarks.diagnosis.plants import Options
from motorctl_benchmarks.diagnosis.record import record_case

RATE_HZ = 5000.0
LONG_S = 600.0
SECONDS_TARGET = Target("value", "<", 10.0)
LONG_TARGET = Target("value", "<", 60.0)
MEMORY_TARGET = Target("value", "<", 2.0)
LINEAR_TARGET = Target("value", "<=", 2.2)
"""Twice the recording, twice the time, and a tenth for what differs between two searches."""
STATUS = Path("/proc/self/status")


@dataclass(frozen=True)
class Cost:
    """What one diagnosis took."""

    wall_s: float
    processor_s: float
    memory_gb: float


def long_case(seed: int, duration_s: float) -> Case:
    """Draw a machine with cogging on one axis, and rich motions one after the other."""
    case = draw_case(seed, effects=("cogging",))
    programs: dict[str, Options] = {}
    for k in range(int(duration_s / DURATION_S) + 1):
        for name, program in with_motion(case.config, seed + k, "rich")["programs"].items():
            if name not in programs:
                programs[name] = program
                continue
            there = _to(program["start_m"], case.config["axes"][program["axis"]]["limits"])
            moves = [*programs[name]["moves"], there, *program["moves"]]
            programs[name] = programs[name] | {"moves": moves}
    return replace(case, config=case.config | {"rate_hz": RATE_HZ, "programs": programs})


def _to(place_m: float, limits: Options) -> Options:
    """Go where the next motion begins, at half of what the axis can."""
    names = ("max_velocity_m_s", "max_acceleration_m_s2", "max_jerk_m_s3")
    return {"target_m": place_m, **{name: 0.5 * limits[name] for name in names}, "dwell_s": 0.1}


def speed_figures(seed: int, progress: Progress) -> tuple[list[Figure], list[str]]:
    """Measure time and memory of a diagnosis; return figures and notes."""
    case = long_case(seed, LONG_S)
    lengths = {"short": DURATION_S, "double": 2.0 * DURATION_S, "long": LONG_S}
    costs: dict[str, Cost] = {}
    with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
        for k, (name, duration_s) in enumerate(lengths.items()):
            log = record_case(case, Path(folder), duration_s=duration_s)
            progress((k + 0.4) / len(lengths))
            costs[name] = _in_a_process(log, None if name == "long" else case.axis)
            log.unlink()
            progress((k + 1.0) / len(lengths))
    processor = ", ".join(f"{name} {cost.processor_s:.3g} s" for name, cost in costs.items())
    return figures_of(costs), [
        "Seconds: a fresh process for each recording, from the log to the diagnosis, with as many "
        f"threads as it takes by itself; growth is that of processor time ({processor})."
    ]


def figures_of(costs: Mapping[str, Cost]) -> list[Figure]:
    """Make figures of the costs of a short recording, one of twice its length, and a long one."""
    growth = costs["double"].processor_s / costs["short"].processor_s
    both = f"{LONG_S:g} s of two axes"
    return [
        Figure(
            "seconds_one_axis",
            f"{DURATION_S:g} s of one axis",
            costs["short"].wall_s,
            "s",
            target=SECONDS_TARGET,
        ),
        Figure("seconds_two_axes", both, costs["long"].wall_s, "s", target=LONG_TARGET),
        Figure("memory_two_axes", both, costs["long"].memory_gb, "GB", target=MEMORY_TARGET),
        Figure("growth", "time as the recording doubles", growth, "x", target=LINEAR_TARGET),
    ]


def _in_a_process(log: Path, axis: str | None) -> Cost:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(cost_of, log, axis).result()


def cost_of(log: Path, axis: str | None) -> Cost:
    """Diagnose one axis of a log, or all of them, in this process."""
    wall, processor = time.monotonic(), time.process_time()
    recording = read_measured(log)
    diagnose_recording(recording, declared_models(recording, None, axis))
    return Cost(time.monotonic() - wall, time.process_time() - processor, peak_memory_gb())


def peak_memory_gb(status: Path = STATUS) -> float:
    """Return the peak resident memory of this process [GB].

    From the kernel's status of the process where there is one: getrusage counts what the parent
    had at the time of the fork.
    """
    try:
        lines = status.read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) * 1024.0 / 1e9
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0 / 1e9
