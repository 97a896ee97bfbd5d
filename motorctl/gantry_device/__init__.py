"""The simulated gantry as a remote device: the other side of CAN, serial and Modbus.

It shares no codec with the drivers and is written from their pages alone.
"""

from motorctl.gantry_device.device import Device
from motorctl.gantry_device.load import load_device
from motorctl.gantry_device.run import report, run_device

__all__ = ["Device", "load_device", "report", "run_device"]
