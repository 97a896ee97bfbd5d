"""What tripped each axis, in words: for the status, the journal and the flight records."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.config.machine import Machine
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.faults import UNTIL_OPENED, fault_message, hides_turns, partner_words
from motorctl.loop.next_steps import next_step


def faults_of(
    machine: Machine, statuses: NDArray[np.void], *, with_remedy: bool = True
) -> dict[str, dict[str, Any] | None]:
    """Return cause and message of every axis' fault; None for an axis without one.

    Parameters
    ----------
    machine
        Whose axes.
    statuses
        Their status records, all of one tick, of `motorctl.loop.layout.axis_status`, shape (axes,).
    with_remedy
        Whether the messages say what to do about it.
    """
    names = list(machine.axes)
    periods_s = [machine.period_of(name) for name in names]
    units = [axis.units for axis in machine.axes.values()]
    return {
        name: fault_of(
            name,
            statuses[i],
            periods_s[i],
            partner_words(i, statuses, names, periods_s, units),
            units[i],
            with_remedy=with_remedy,
        )
        for i, name in enumerate(names)
    }


def fault_of(
    axis: str,
    status: np.void,
    period_s: float,
    partner: str = "",
    units: AxisUnits = LINEAR,
    *,
    with_remedy: bool = True,
) -> dict[str, Any] | None:
    """Return cause, guard, code and message of an axis' fault; None without one.

    Parameters
    ----------
    axis
        Name of the axis, for the command that clears the fault.
    status
        The axis' status record, of `motorctl.loop.layout.axis_status`.
    period_s
        Period of the axis [s].
    partner
        Why another axis tripped that this one was stopped for, from `partner_words`.
    units
        Of the axis.
    with_remedy
        Whether the message says what to do about it.
    """
    if AxisState(int(status["state"])) is not AxisState.FAULT:
        return None
    cause = FaultCause(int(status["fault"]))
    value, limit, time_s = (float(status[f"fault_{part}"]) for part in ("value", "limit", "time_s"))
    word = int(status["fault_status"])
    message = fault_message(
        cause, value, limit, time_s, period_s=period_s, status=word, partner=partner, units=units
    )
    named = {"cause": cause.name.lower(), "guard": cause.guard, "code": int(cause)}
    if not with_remedy:
        return {**named, "message": message}
    step = next_step(
        cause,
        axis,
        status=word,
        hidden_turns=hides_turns(value, limit),
        on_switch=limit == 0.0,
        homed=bool(status["homed"]),
    )
    remedy = f"`motorctl reset {axis}` clears the fault"
    if word & UNTIL_OPENED:
        remedy = (
            f"once the device is back, `motorctl reset {axis}` opens it anew and clears the fault"
        )
    return {**named, "message": f"{message}; {step}; {remedy}"}
