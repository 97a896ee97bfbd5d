"""A recording of one axis of a machine, and what that machine truly is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MachineRecording:
    """What a generator of machines gives."""

    generator: str
    kind: str
    """What the machine has beyond mass, viscous and Coulomb friction and an offset; or "none"."""
    story: str
    """The machine in a sentence, with the numbers that matter."""
    time_s: Array
    position: Array
    """(N,) measured, in position_unit."""
    command: Array
    """(N,) in command_unit."""
    reference: Array | None
    """(N,) desired position, where it is recorded."""
    position_unit: str
    """"m" or "rad"."""
    command_unit: str
    """"V", "A", "N" or "N m"."""
    resolution: float
    """Step of the encoder, in position_unit."""
    friction_shape: str
    noise: int
    """0 none, 1 white on position, 2 coloured, 3 coarse encoder."""
