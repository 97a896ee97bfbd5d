"""Drivers with one thing wrong each, and the checks that fail for it: these and no others."""

from broken_drivers import declarations, faults, life, values
from broken_drivers.registry import BROKEN, rig_class

__all__ = ["BROKEN", "declarations", "faults", "life", "rig_class", "values"]
