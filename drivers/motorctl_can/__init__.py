"""Amplifiers and encoders on CAN, described in YAML or DBC: the plug-in behind ``type: can``."""

from motorctl_can.driver import CanDriver
from motorctl_can.options import CanOptions

__all__ = ["CanDriver", "CanOptions"]
