"""Guards of the command: nothing leaves that is no number or beyond the voltage limit."""

from __future__ import annotations

import math
from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.guards.reactions import trip

FAULT = int(AxisState.FAULT)
CAUSE_NOT_A_NUMBER = int(FaultCause.NOT_A_NUMBER)


@inner_kernel
def checked_voltage(settings: Any, axis: Any, u: float, v: float, t: float) -> float:
    """Return the command that may leave: within the voltage limit, zero where the axis tripped.

    v is the virtual command that u was found for.
    """
    if not (math.isfinite(u) and math.isfinite(v)):
        trip(axis, CAUSE_NOT_A_NUMBER, 0.0, settings.max_voltage_v, t)
    if axis.state == FAULT:
        return 0.0
    return min(max(u, -settings.max_voltage_v), settings.max_voltage_v)  # type: ignore[no-any-return]
