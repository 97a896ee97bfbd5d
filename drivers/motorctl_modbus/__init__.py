"""An amplifier and encoder coupler on Modbus TCP or RTU: the plug-in behind ``type: modbus``."""

from motorctl_modbus.driver import ModbusDriver
from motorctl_modbus.options import ModbusOptions

__all__ = ["ModbusDriver", "ModbusOptions"]
