"""Simulate a machine in virtual time and log it: what `simulate`, `demo` and tests run."""

from __future__ import annotations

import copy
import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import Machine
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.errors import UsageError
from motorctl.log import LogWriter
from motorctl.loop.virtual import VirtualMachine, require_virtual_time

HOLD_S = 1.0
"""How long a machine without programs is simulated, unless told otherwise."""
MORE_S = 0.1
"""Rest recorded after the last program, so that its last sample is in the log."""

Progress = Callable[[float], None]
"""Told the share that is done, 0 to 1."""


@dataclass(frozen=True)
class Simulation:
    """What a simulation gave."""

    log: Path
    duration_s: float
    wall_s: float
    turnaround_s: NDArray[np.float64]
    """Wall-clock turnaround of every tick, shape (ticks,): computing takes time here too."""
    notes: tuple[str, ...] = ()
    """Why what was learned for a program was not used, a sentence each."""

    @property
    def times_real_time(self) -> float:
        """Simulated seconds a second."""
        return self.duration_s / self.wall_s

    @property
    def turnaround(self) -> dict[str, float]:
        """Median, 99th percentile and worst turnaround."""
        p50, p99 = np.percentile(self.turnaround_s, [50, 99])
        return {"p50_s": float(p50), "p99_s": float(p99), "max_s": float(self.turnaround_s.max())}


def with_seed(machine: Machine, seed: int) -> Machine:
    """Return the machine with another seed in every driver that has one.

    Raises
    ------
    UsageError
        Where no driver has a seed, or this is none.
    """
    if seed < 0:
        raise UsageError(f"--seed {seed}: should be 0 or above")
    seeded = False
    drivers = dict(machine.drivers)
    resolved: dict[str, Any] = copy.deepcopy(dict(machine.resolved))
    for name, setup in machine.drivers.items():
        if "seed" in type(setup.options).model_fields:
            seeded = True
            options = setup.options.model_copy(update={"seed": seed})
            drivers[name] = dataclasses.replace(setup, options=options)
            resolved["drivers"][name]["seed"] = seed
    if not seeded:
        raise UsageError(
            f"--seed {seed} has no effect: no driver of {machine.name} takes a seed; leave it out"
        )
    return dataclasses.replace(machine, drivers=drivers, resolved=resolved)


def simulate(
    machine: Machine,
    log: Path,
    *,
    duration_s: float | None = None,
    progress: Progress | None = None,
) -> Simulation:
    """Start every axis, let each follow its program, and log every tick.

    Parameters
    ----------
    machine
        What to simulate; all of its drivers support virtual time.
    log
        Where the log shall be: a .parquet file in a folder that exists.
    duration_s
        How long [s]; None: until the longest program has ended.
    progress
        Called with the share that is done, 0 to 1.

    Raises
    ------
    UsageError
        Where the log's name, the duration or a driver does not allow it.
    RunError
        Where an axis trips; the log then ends there and is complete.
    """
    if log.suffix != ".parquet" or not log.parent.is_dir():
        raise UsageError(f"{log}: must end in .parquet and lie in a folder that exists")
    if duration_s is not None and not 0.0 < duration_s < np.inf:
        raise UsageError(f"duration {duration_s:g} s: must be finite and above 0")
    require_virtual_time(machine)
    axes = log_axes(machine)
    # said before the first row: what ends early was simulated as well
    writer = LogWriter(log, {**log_metadata(machine), "virtual_time": {}}, axes)
    extra: dict[str, Any] = {}
    try:
        with VirtualMachine(machine, writer.append) as virtual:
            began = time.monotonic()
            virtual.start()
            programs = machine.followed_programs
            needed_s = virtual.follow_programs(programs)
            if duration_s is None:
                total = virtual.ticks + round((needed_s + MORE_S) * machine.rate_hz)
                if not programs:
                    total = virtual.ticks + round(HOLD_S * machine.rate_hz)
            else:
                total = round(duration_s * machine.rate_hz)
            while virtual.ticks < total:
                virtual.advance(min(total - virtual.ticks, round(machine.rate_hz)))
                virtual.raise_faults()
                if progress:
                    progress(virtual.ticks / total)
            wall_s = time.monotonic() - began
            result = Simulation(
                log,
                virtual.ticks * machine.period_s,
                wall_s,
                virtual.turnaround_s[:, 0],
                tuple(virtual.notes),
            )
            extra = {"virtual_time": {"wall_s": wall_s, "turnaround": result.turnaround}}
            if result.notes:
                extra["notes"] = list(result.notes)
    finally:
        if writer.rows_taken:
            writer.close(extra)
        else:  # nothing has ticked: what stands under that name stays
            writer.discard()
    return result
