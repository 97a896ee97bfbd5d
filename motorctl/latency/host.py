"""The machine that figures were measured on."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path("/")
STEAL = 8
"""The word of a CPU's line in /proc/stat that counts stolen time."""


def host_facts() -> dict[str, Any]:
    """Return what a reader of figures needs to know of this machine, and how busy it is."""
    load = os.getloadavg()[0]
    return {
        "name": platform.node(),
        "cpu": _cpu_model(),
        "cpus": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "numba": version("numba"),
        "load_average_1_min": round(load, 2),
    }


def host_line(facts: dict[str, Any]) -> str:
    """Say it in one line."""
    return (
        f"{facts['cpu']}, {facts['cpus']} CPUs, Linux {facts['kernel']}, "
        f"Python {facts['python']}, numpy {facts['numpy']}, numba {facts['numba']}; "
        f"load average {facts['load_average_1_min']:g}"
    )


def stolen_s(cpu: int, root: Path = ROOT) -> float:
    """Return how long a hypervisor has kept this CPU from us since it was started.

    root is where /proc is looked for.
    """
    try:
        lines = (root / "proc/stat").read_text().splitlines()
    except OSError:
        return 0.0
    for line in lines:
        words = line.split()
        if words[0] == f"cpu{cpu}" and len(words) > STEAL:
            return int(words[STEAL]) / os.sysconf("SC_CLK_TCK")
    return 0.0


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()
