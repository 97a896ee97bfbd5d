"""Run every path of the tick once on memory of its own, so that nothing compiles while running."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.hal import Driver, DriverOptions, Inputs, Outputs, RateBudget
from motorctl.kernels import is_kept, specialise
from motorctl.loop.runner import VirtualRun
from motorctl.loop.shared import LoopMemory
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Verb

WARM_UP_TICKS = 400


class Unconnected(Driver):
    """A driver without a device: the counts stand still, the volts go nowhere."""

    Options = DriverOptions
    supports_virtual_time = True

    def rate_budget(self) -> RateBudget:
        """No bus, no limit."""
        return RateBudget(1e9, "no bus")

    def open(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def read(self, inputs: Inputs) -> None:
        """Leave the counts as they are."""

    def write(self, outputs: Outputs) -> None:
        """Drop the volts."""

    def safe(self) -> None:
        """Nothing to make safe."""

    def start_virtual_time(self) -> None:
        """Nothing depends on time."""

    def advance(self) -> None:
        """Nothing moves."""


class _Analysed(Tick):
    """A tick of which the steps are analysed, and nothing is made that runs."""

    def _compiled(self) -> Callable[..., Any]:
        module, arguments = self._compose(), self._all_arguments()
        if not is_kept(module.tick, *arguments):
            specialise(module.steps, *arguments)
        return _never


def analyse_steps(machine: Machine) -> None:
    """Leave in the cache of kernels what compiling this machine's tick needs for its laws.

    Where the tick is there, nothing is needed.
    """
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    _Analysed(machine, memory, virtual=True, driver_class=Unconnected)
    memory.close()


def warm_up(machine: Machine) -> None:
    """Compile, or load from the cache, and exercise the tick of this machine."""
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    tick = Tick(machine, memory, virtual=True, driver_class=Unconnected)
    run = VirtualRun(tick)
    for i in range(len(machine.axes)):
        memory.post(Verb.START, i)
    run.advance(WARM_UP_TICKS)
    memory.post(Verb.SHUTDOWN)
    run.advance(WARM_UP_TICKS)
    memory.close()


def _never(*_: object) -> bool:
    raise AssertionError("a tick that was only analysed is called")
