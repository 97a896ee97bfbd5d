"""A device that is no simulation, for the loop process to import."""

from __future__ import annotations

from typing import ClassVar

from motorctl_sim import SimDriver


class Device(SimDriver):
    """The simulated gantry in the role of real hardware."""

    simulated: ClassVar[bool] = False
