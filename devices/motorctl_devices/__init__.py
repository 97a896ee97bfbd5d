"""The simulated gantry as a remote device: the other side of CAN, serial and Modbus.

It shares no codec with the drivers and is written from their pages alone.
"""

from motorctl_devices.device import Device
from motorctl_devices.load import load_device
from motorctl_devices.run import report, run_device

__all__ = ["Device", "load_device", "report", "run_device"]
