"""The configuration of a new machine, from what a person or its devices know of it."""

from motorctl.init.known import AxisKnown, MachineKnown
from motorctl.init.write import Written, write_configuration

__all__ = ["AxisKnown", "MachineKnown", "Written", "write_configuration"]
