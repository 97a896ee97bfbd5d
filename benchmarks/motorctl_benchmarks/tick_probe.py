"""A machine in virtual time whose ticks are timed one by one, as a whole and in parts."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import Machine
from motorctl.hal import Driver
from motorctl.loop import VirtualMachine

Array = NDArray[np.float64]

PARTS = ("whole", "read", "compute", "write", "publish")
"""Columns of what `TickProbe.run` gives. Publish is what the whole has beyond the other parts."""
SETTLING_TICKS = 200


class TickProbe:
    """Follows every program of a machine; the time that simulating takes is left out."""

    def __init__(self, machine: Machine) -> None:
        self._simulating_ns = [0]
        drivers = {
            name: dataclasses.replace(setup, cls=_timed(setup.cls, self._simulating_ns))
            for name, setup in machine.drivers.items()
        }
        self._machine = dataclasses.replace(machine, drivers=drivers)
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Self:
        virtual = VirtualMachine(self._machine, lambda _ticks, _samples: None)
        self._virtual = self._open.enter_context(virtual)
        virtual.start()
        virtual.follow_programs(self._machine.followed_programs)
        virtual.advance(SETTLING_TICKS)
        self._whole_ns: list[int] = []
        self._step = virtual.tick.step
        virtual.tick.step = self._timed_step
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._open.close()

    def run(self, ticks: int) -> Array:
        """Run so many ticks; return the columns PARTS [s], shape (ticks, 5)."""
        self._whole_ns.clear()
        self._virtual.advance(ticks)
        times = np.empty((ticks, len(PARTS)))
        times[:, 0] = np.array(self._whole_ns) * 1e-9
        times[:, 1:4] = self._virtual.turnaround_s[-ticks:, 1:]
        times[:, 4] = times[:, 0] - times[:, 1:4].sum(axis=1)
        return times

    def _timed_step(
        self, number: int, elapsed: int, overran: bool, scheduled_ns: int, _woke_ns: int
    ) -> bool:
        self._simulating_ns[0] = 0
        began = time.monotonic_ns()
        may_end = self._step(number, elapsed, overran, scheduled_ns, began)
        self._whole_ns.append(time.monotonic_ns() - began - self._simulating_ns[0])
        return may_end


def _timed(driver: type[Driver], spent_ns: list[int]) -> type[Driver]:
    """Return a driver that adds the time of its simulation to spent_ns[0]."""

    class Timed(driver):  # type: ignore[misc, valid-type]
        def advance(self) -> None:
            began = time.monotonic_ns()
            super().advance()
            spent_ns[0] += time.monotonic_ns() - began

    return Timed
