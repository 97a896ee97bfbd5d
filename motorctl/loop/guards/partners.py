"""Axes that stop together: when one trips, its partners are brought to rest."""

from __future__ import annotations

from typing import Any

from motorctl.kernels import inner_kernel
from motorctl.log.sample import FaultCause
from motorctl.loop.guards.reactions import react_to_others
from motorctl.loop.states import State


@inner_kernel
def stop_partners(settings: Any, axes: Any, t: float) -> None:
    """Let the partners of every axis that has just tripped ramp down; they end in FAULT.

    Each fault is passed on once: a partner that is reset may be moved while the other is not. The
    value of a partner's fault is the number of the axis that it was stopped for.
    """
    for i in range(axes.size):
        axis = axes[i]
        if axis.fault == 0:
            axis.passed_on = 0
        elif not axis.passed_on:
            axis.passed_on = 1
            for j in range(axes.size):
                partner = axes[j]
                if j != i and partner.fault == 0 and _are_partners(settings, axes, i, j):
                    react_to_others(settings[j], partner, FaultCause.PARTNER, float(i), 0.0, t)


@inner_kernel
def _are_partners(settings: Any, axes: Any, i: int, j: int) -> bool:
    """Return whether axis j stops when axis i trips: of one group, or on one program."""
    if settings[i].group != 0 and settings[i].group == settings[j].group:
        return True
    together = settings[i].stops_with_program and axes[j].state == State.FOLLOWING
    return together and axes[i].program != 0 and axes[i].program == axes[j].program  # type: ignore[no-any-return]
