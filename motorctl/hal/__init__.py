"""What a driver is: the contract, the registry, the budget of a bus."""

from motorctl.errors import RunError
from motorctl.hal.claim import Claim
from motorctl.hal.contract import (
    FAULT_BITS,
    Channel,
    Driver,
    DriverOptions,
    Inputs,
    NetworkInterface,
    Outputs,
    RateBudget,
    Status,
    serial_line,
)
from motorctl.hal.registry import DriverEntry, driver_class, installed_drivers
from motorctl.kernels import inner_kernel, kernels_cached, specialise

__all__ = [
    "FAULT_BITS",
    "Channel",
    "Claim",
    "Driver",
    "DriverEntry",
    "DriverOptions",
    "Inputs",
    "NetworkInterface",
    "Outputs",
    "RateBudget",
    "RunError",
    "Status",
    "driver_class",
    "inner_kernel",
    "installed_drivers",
    "kernels_cached",
    "serial_line",
    "specialise",
]
