"""The simulated gantry, with a file that tells which process made the outputs safe."""

from __future__ import annotations

import os
from pathlib import Path
from typing import ClassVar

from motorctl.hal import DriverOptions
from motorctl_sim import SimDriver
from motorctl_sim.options import SimOptions


class MarkingOptions(SimOptions):
    """The gantry's options, and where to write."""

    mark: Path


class MarkingDriver(SimDriver):
    """Writes a line with the process' number each time the outputs are made safe."""

    Options: ClassVar[type[DriverOptions]] = MarkingOptions

    def safe(self) -> None:
        """Make the outputs safe, and say who did."""
        super().safe()
        assert isinstance(self.options, MarkingOptions)
        with self.options.mark.open("a") as mark:
            mark.write(f"{os.getpid()}\n")


class OutOfReach(SimDriver):
    """Whose device no longer gets what would zero and disable it."""

    def safe(self) -> None:
        """Say that nothing was sent."""
        self.safe_sent, self.safe_failed = False, "the line is cut"
