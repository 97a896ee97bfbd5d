"""A box of amplifiers and encoders on a serial line: the plug-in behind ``type: serial``."""

from motorctl_serial.driver import SerialDriver
from motorctl_serial.options import Rs485Options, SerialOptions

__all__ = ["Rs485Options", "SerialDriver", "SerialOptions"]
