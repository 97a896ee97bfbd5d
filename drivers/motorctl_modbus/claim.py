"""One program at a time: a device on Modbus TCP obeys everybody, and two hosts would both drive."""

from __future__ import annotations

import errno
import socket

from motorctl.hal import RunError
from motorctl_modbus.layout import OutputBlock
from motorctl_modbus.options import ModbusOptions


def claim(options: ModbusOptions, outputs: OutputBlock) -> socket.socket | None:
    """Claim these registers of the device on this machine, until what is given back is closed.

    None on a serial line, whose port is claimed by itself. Raises RunError where another program
    has them. The kernel releases the claim of a process that died.
    """
    if options.tcp is None:
        return None
    end = outputs.address + outputs.count
    name = f"\0motorctl-modbus {options.device} unit {options.unit} {outputs.address}-{end}"
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(name)
    except OSError as error:
        held.close()
        if error.errno != errno.EADDRINUSE:
            return None  # without such names there is no claim, but a device that works
        raise RunError(
            f"tcp: {options.device}, unit {options.unit}: its outputs are driven by another "
            "program on this machine"
        ) from error
    return held
