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
from motorctl.hal.error_codes import (
    CODE_MASK,
    DISABLE_LATE,
    DRIVE_STATES,
    ENABLE_LATE,
    LEFT_OPERATION,
    error_bits,
    error_code,
    error_words,
)
from motorctl.hal.first_options import FirstAxis, FirstOptions, FoundAxis, FoundDevice
from motorctl.hal.limit_switches import (
    LIMIT_SWITCHES,
    UNTOLD_GUARDS,
    unseen_limit_switches,
    untold_guard,
)
from motorctl.hal.registry import DriverEntry, driver_class, installed_drivers
from motorctl.hal.way import Way
from motorctl.kernels import inner_kernel, kernels_cached, specialise

__all__ = [
    "CODE_MASK",
    "DISABLE_LATE",
    "DRIVE_STATES",
    "ENABLE_LATE",
    "FAULT_BITS",
    "LEFT_OPERATION",
    "LIMIT_SWITCHES",
    "UNTOLD_GUARDS",
    "Channel",
    "Claim",
    "Driver",
    "DriverEntry",
    "DriverOptions",
    "FirstAxis",
    "FirstOptions",
    "FoundAxis",
    "FoundDevice",
    "Inputs",
    "NetworkInterface",
    "Outputs",
    "RateBudget",
    "RunError",
    "Status",
    "Way",
    "driver_class",
    "error_bits",
    "error_code",
    "error_words",
    "inner_kernel",
    "installed_drivers",
    "kernels_cached",
    "serial_line",
    "specialise",
    "unseen_limit_switches",
    "untold_guard",
]
