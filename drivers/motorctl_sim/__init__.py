"""A simulated gantry of coupled axes: the plug-in behind ``type: sim``."""

from motorctl_sim.driver import SimDriver, TrueState
from motorctl_sim.options import SimOptions

__all__ = ["SimDriver", "SimOptions", "TrueState"]
