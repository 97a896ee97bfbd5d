"""Simulate a machine and keep where its carriages truly were, which no encoder shows."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config import Machine
from motorctl.hal import Driver, Inputs
from motorctl.log.sample import AxisState
from motorctl.loop import VirtualMachine

Array = NDArray[np.float64]

SETTLING_S = 0.6
"""Left out after the start: there the law takes over an axis that something pulls at."""


def true_error_rms_m(machine: Machine, axis: str, duration_s: float) -> float:
    """Run a simulated machine's programs; return the rms of true position minus reference [m].

    The true position is the simulated plant's own at the time of each reading: without the
    encoder's error, noise and quantisation. Raises RunError where an axis trips.
    """
    seen: list[Array] = []
    setup = machine.axes[axis]
    drivers = {
        name: dataclasses.replace(d, cls=_watched(d.cls, seen)) if name == setup.driver else d
        for name, d in machine.drivers.items()
    }
    index = list(machine.axes).index(axis)
    rows: list[NDArray[np.void]] = []
    watched = dataclasses.replace(machine, drivers=drivers)
    with VirtualMachine(watched, lambda _, samples: rows.append(samples[:, index])) as virtual:
        virtual.start()
        virtual.follow_programs(machine.followed_programs)
        before = len(seen) - virtual.ticks
        virtual.advance(round(duration_s * machine.rate_hz) - virtual.ticks)
        virtual.raise_faults()
    samples = np.concatenate(rows)
    position = np.array(seen[before:])[:, setup.channel]
    error = position[: len(samples)] - samples["reference_m"]
    used = samples["state"] == AxisState.RUNNING
    used[: round(SETTLING_S * machine.rate_hz)] = False
    return float(np.sqrt(np.mean(error[used] ** 2)))


def _watched(driver: type[Driver], seen: list[Array]) -> type[Driver]:
    """Return a driver that adds the true positions to `seen` at every reading."""

    class Watched(driver):  # type: ignore[misc, valid-type]
        def read(self, inputs: Inputs) -> None:
            true: Any = self.true_state()
            seen.append(true.position_m)
            super().read(inputs)

    return Watched
