"""What a guard does when it trips."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import AxisState
from motorctl.loop.reference import UNDECIDED

HOMING = int(AxisState.HOMING)
IDLE = int(AxisState.IDLE)
RUNNING = int(AxisState.RUNNING)
STOPPING = int(AxisState.STOPPING)
FAULT = int(AxisState.FAULT)


@inner_kernel
def trip(axis: Any, cause: int, value: float, limit: float, t: float) -> None:
    """Put the axis into FAULT, keeping the first cause with its value and limit.

    An axis that is being stopped for a cause has that one already.
    """
    if axis.state != FAULT:
        if axis.fault == 0:
            axis.fault = cause
            axis.fault_value = value
            axis.fault_limit = limit
            axis.fault_time_s = t
            axis.fault_status = axis.status | axis.held_status
        axis.state = FAULT
        axis.slot = -1


@inner_kernel
def stop(axis: Any, cause: int, t: float) -> None:
    """Let an enabled axis ramp down and switch off; with a cause it ends in FAULT."""
    if axis.state in (IDLE, RUNNING, HOMING):
        axis.state = STOPPING
        axis.brake = UNDECIDED
        axis.slot = -1
        axis.fault = cause
        if not cause:
            axis.program = 0
        else:
            axis.fault_value, axis.fault_limit, axis.fault_time_s = 0.0, 0.0, t
            axis.fault_status = axis.status
