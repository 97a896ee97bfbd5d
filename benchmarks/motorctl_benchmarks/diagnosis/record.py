"""Record a case: the same loop as everywhere, in virtual time, into a log that tells no cause."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from motorctl.config import Machine, load_resolved
from motorctl.loop.simulation import simulate
from motorctl_benchmarks.diagnosis.cases import Case
from motorctl_benchmarks.diagnosis.motions import DURATION_S

_TOLD_OF_A_DRIVER = ("type",)


def record_case(case: Case, folder: Path, *, duration_s: float = DURATION_S) -> Path:
    """Simulate the case; return its log, named after it, in a folder that exists.

    Raises ConfigError where the configuration is wrong, RunError where an axis trips.
    """
    log = folder / f"{case.name}.parquet"
    simulate(
        _blinded(load_resolved(case.config, case.name, hardware=True)), log, duration_s=duration_s
    )
    return log


def _blinded(machine: Machine) -> Machine:
    """Take the plants out of what the log will say of the machine, and nothing else."""
    resolved: dict[str, Any] = dict(machine.resolved)
    resolved["drivers"] = {
        name: {key: part for key, part in options.items() if key in _TOLD_OF_A_DRIVER}
        for name, options in resolved["drivers"].items()
    }
    return dataclasses.replace(machine, resolved=resolved)
