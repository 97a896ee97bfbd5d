"""Drives that speak CiA 402 over CANopen, in torque mode: the plug-in behind ``type: canopen``."""

from motorctl_canopen.driver import CanopenDriver
from motorctl_canopen.options import CanopenOptions

__all__ = ["CanopenDriver", "CanopenOptions"]
