"""Devices that break: on opening, or their contract in the middle of a run."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from motorctl.errors import RunError
from motorctl.hal import DriverOptions, Inputs
from motorctl_sim import SimDriver, SimOptions


class Failing(DriverOptions):
    """Where a line is left each time the outputs are made safe."""

    mark: Path


class RaisesWhileReading(SimDriver):
    """Reads a hundred times, then raises."""

    Options: ClassVar[type[DriverOptions]] = Failing

    def __init__(self, options, channels, period_s):
        super().__init__(SimOptions.model_validate({}), channels, period_s)
        self.mark = options.mark
        self.reads = 0

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        self.reads += 1
        if self.reads > 100:
            raise OSError("the cable is out")

    def safe(self) -> None:
        super().safe()
        with self.mark.open("a") as mark:
            mark.write("safe\n")


class DoesNotOpen(RaisesWhileReading):
    """Is not there."""

    def open(self) -> None:
        raise RunError("no device at the other end")
