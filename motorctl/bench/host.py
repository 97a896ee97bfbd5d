"""The machine that figures were measured on."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any


def host_facts() -> dict[str, Any]:
    """Give what a reader of figures needs to know of this machine, and how busy it is."""
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


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()
