"""Guard of the skew: the two motors of one beam must not pull its ends apart."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.guards.reactions import react, trip

CAUSE_SKEW = int(FaultCause.SKEW)
LET_GO_RATIO = 2.0
"""A ramp on which the skew grows to this many times its limit is broken off."""


@inner_kernel
def check_skew(settings: Any, axis: Any, dual: Any, t: float) -> None:
    """Trip where one end is too far ahead of the other.

    Of an axis that knows what is square, the skew counts from there; of another one, from where
    the skew loop holds it.
    """
    skew = dual.skew_m if dual.squared else dual.skew_m - dual.reference_m
    limit = settings.skew_limit_m
    if abs(skew) > LET_GO_RATIO * limit:
        trip(axis, CAUSE_SKEW, skew, limit, t)
    elif abs(skew) > limit:
        react(settings, axis, CAUSE_SKEW, skew, limit, t)
