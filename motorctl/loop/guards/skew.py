"""Guards of the skew: the two motors of one beam must not pull its ends apart."""

from __future__ import annotations

import math
from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.guards.reactions import react, trip

LET_GO_RATIO = 2.0
"""A ramp on which the skew grows to this many times its limit is broken off."""


@inner_kernel
def check_skew(settings: Any, dual_settings: Any, axis: Any, dual: Any, t: float) -> None:
    """Trip where the ends are too far apart from how they are held, or cannot be squared at all.

    They are held square, once that is known and the beam has been led there. A beam that stands
    further askew than homing would allow is not even started.
    """
    skew, limit = dual.skew_m - dual.reference_m, settings.skew_limit_m
    most = max(limit, dual_settings.max_out_of_square_m)
    if (axis.fresh or dual.unchecked) and dual.squared and abs(dual.skew_m) > most:
        trip(axis, FaultCause.SKEW, dual.skew_m, most, t)
    elif abs(skew) > LET_GO_RATIO * limit:
        trip(axis, FaultCause.SKEW, skew, limit, t)
    elif abs(skew) > limit:
        react(settings, axis, FaultCause.SKEW, skew, limit, t)


@inner_kernel
def check_skew_command(axis: Any, du_v: float, limit_v: float, t: float) -> bool:
    """Return whether the skew loop's command is a number; trip where it is none."""
    if math.isfinite(du_v):
        return True
    trip(axis, FaultCause.NOT_A_NUMBER, 0.0, limit_v, t)
    return False
