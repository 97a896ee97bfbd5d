"""Say in words why an axis is in the state FAULT, and what a driver reports."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.hal import FAULT_BITS, Status, error_code, error_words
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import (
    COMMAND_PERIODS,
    COOLED_RATIO,
    STALL_LIMIT_MASK,
    STALL_LIMIT_SHIFT,
    StallLimit,
)
from motorctl.loop.guards.device import ENDS, FIRST_END, SECOND_END

_WITH_LIMIT = {
    FaultCause.FOLLOWING_ERROR: ("following error", 1e3, "mm"),
    FaultCause.SOFT_LIMIT: ("position beyond the soft limit:", 1e3, "mm"),
    FaultCause.OVERSPEED: ("speed", 1.0, "m/s"),
    FaultCause.ENCODER_STUCK: (
        "the count did not change (a stuck encoder or a blocked axis) while the reference moved",
        1e3,
        "mm",
    ),
    FaultCause.ENCODER_NOISE: (
        "encoder noise at standstill, second difference of the position",
        1e6,
        "um rms",
    ),
    FaultCause.SATURATION: (
        "the command stood at limits.max_voltage_v (a blocked, overloaded or oscillating axis) "
        "longer than below it, by",
        1.0,
        "s",
    ),
    FaultCause.SKEW: ("skew: the beam's first end is ahead of the second by", 1e3, "mm"),
    FaultCause.NOT_SQUARE: (
        "homing: by the switches or marks of its two ends the beam is out of square by",
        1e3,
        "mm",
    ),
    FaultCause.THERMAL: ("the motor is too warm: rms command", 1.0, "V"),
}
_WITHOUT_LIMIT = {
    FaultCause.NOT_A_NUMBER: "the control law computed a command that is not a finite number",
    FaultCause.ENCODER_LOST: "the encoder's signal is lost",
    FaultCause.AMPLIFIER: "the amplifier reports a fault",
    FaultCause.COMMUNICATION: "communication with the device is lost",
    FaultCause.ESTOP: "emergency stop",
    FaultCause.PARTNER: "an axis tripped that this one stops together with",
}


def hides_turns(value: float, limit: float) -> bool:
    """Return whether a jump is no step that is too large, but one that may hide whole turns."""
    return abs(value) <= limit


def _jump_words(value: float, limit: float, status: int) -> str:
    if hides_turns(value, limit):
        return (
            "the encoder's counter may have gone round while no sample came: its step of "
            f"{value * 1e3:.4g} mm may hide whole turns"
        )
    return (
        f"the encoder's count jumped by {value * 1e3:.4g} mm, limit {limit * 1e3:.4g} mm: further "
        "than the axis can have moved since the last sample"
    )


def _switch_words(value: float, limit: float, status: int) -> str:
    ends = {Status.LIMIT_NEGATIVE: "negative ", Status.LIMIT_POSITIVE: "positive "}
    pressed = [name for bit, name in ends.items() if status & bit]
    which = pressed[0] if len(pressed) == 1 else ""
    return f"the {which}limit switch ahead is pressed, position {value * 1e3:.4g} mm"


def _homing_words(value: float, limit: float, status: int) -> str:
    if limit > 0.0:
        return (
            f"homing found no switch or index mark in {value:.4g} s, limit {limit:.4g} s "
            "(homing.timeout_s)"
        )
    return (
        "homing ran onto a limit switch before it found its switch or index mark, position "
        f"{value * 1e3:.4g} mm"
    )


def _late_words(value: float, limit: float, status: int) -> str:
    return (
        f"late ticks: {limit:.0f} more overruns and skipped periods than ticks in time, by "
        "loop.overrun_policy and bucket_size"
    )


def _silence_words(value: float, limit: float, status: int) -> str:
    return (
        f"the supervisor process sent no sign of life for {value:.3g} s, limit {limit:.3g} s "
        "(loop.supervisor_timeout_s)"
    )


_SENTENCES: dict[FaultCause, Callable[[float, float, int], str]] = {
    FaultCause.ENCODER_JUMP: _jump_words,
    FaultCause.LIMIT_SWITCH: _switch_words,
    FaultCause.HOMING_FAILED: _homing_words,
    FaultCause.OVERRUN: _late_words,
    FaultCause.SUPERVISOR_LOST: _silence_words,
}
"""Of value, limit and the driver's status word."""
_DEVICE = {
    Status.BUS_OFF: "the bus or the port is gone",
    Status.DEVICE_RESTARTED: "the device restarted, or was silent for so long that it may have",
    Status.CORRUPT: "a message was refused (checksum, length or sequence), or the bus had no room",
}
"""What a driver may add to the cause."""
_TROUBLES = {
    Status.ENCODER_LOST: _WITHOUT_LIMIT[FaultCause.ENCODER_LOST],
    Status.AMPLIFIER_FAULT: _WITHOUT_LIMIT[FaultCause.AMPLIFIER],
    Status.COMMUNICATION_LOST: _WITHOUT_LIMIT[FaultCause.COMMUNICATION],
    Status.ESTOP: _WITHOUT_LIMIT[FaultCause.ESTOP],
    Status.STALE: "no new sample arrives",
}
_STALL_LIMITS = {
    StallLimit.HOST_FROZEN: "guards.host_frozen.time_s",
    StallLimit.WATCHDOG: "its device's watchdog, beyond which the amplifier is off",
    StallLimit.COMMANDS_APART: (
        f"its device's watchdog less {COMMAND_PERIODS} periods, as commands lie further apart than "
        "a pause lasts"
    ),
    StallLimit.HOLD_TICKS: "its driver's late.hold_ticks",
    StallLimit.COUNTER: (
        "in which the counter may turn a quarter round at 1.2 times limits.max_velocity_m_s: "
        "encoder.counter_bits"
    ),
}
"""Which limit it was, with its key."""
_ENDS = {
    FIRST_END: "at the first end",
    SECOND_END: "at the second end",
    ENDS: "at both ends",
}
UNTIL_OPENED = Status.BUS_OFF | Status.DEVICE_RESTARTED
"""What mostly stays until the driver is opened again."""


def needs_opening(status: int, all_of_driver: Sequence[int]) -> bool:
    """Return whether only a driver that is opened anew can bring an axis' device back.

    Parameters
    ----------
    status
        The driver's status word for this axis: bits of `motorctl.hal.Status`.
    all_of_driver
        Those of all axes of the driver. One of them that is not reached may be a matter of the
        device; where none is, the bus is gone.
    """
    lost = all(word & Status.COMMUNICATION_LOST for word in all_of_driver)
    return bool(status & UNTIL_OPENED) or lost


def device_message(status: int) -> str:
    """Return in words what a driver reports that keeps an axis from being started.

    Parameters
    ----------
    status
        The driver's status word: bits of `motorctl.hal.Status`.

    Returns
    -------
    str
        Empty where it reports nothing.
    """
    said = [words for bit, words in (_TROUBLES | _DEVICE).items() if status & bit]
    told = "; ".join(said + _code_words(status))
    if status & UNTIL_OPENED:
        told += "; once the device is back, `motorctl reset` opens it anew"
    return told


def _code_words(status: int) -> list[str]:
    code = error_code(status) if status & Status.AMPLIFIER_FAULT else 0
    return [error_words(code)] if code else []


def lasting_words(cause: FaultCause) -> str:
    """Return in words what of an axis' fault keeps it from being reset, though its device is well.

    Parameters
    ----------
    cause
        Why the axis is in FAULT.
    """
    if cause is FaultCause.THERMAL:
        return (
            f"the motor has not cooled down to {COOLED_RATIO:.0%} of "
            "guards.thermal.continuous_voltage_v; wait a part of guards.thermal.time_constant_s"
        )
    if cause is FaultCause.ENCODER_NOISE:
        return (
            "the encoder's count still trembles by more than guards.encoder_noise.rms_m; look at "
            "its cable, its shield and its head"
        )
    if cause is FaultCause.NOT_A_NUMBER:
        return (
            "one of its learned parameters is no finite number, and each start would begin with "
            "it; a new start of the daemon begins with the saved or the configured ones"
        )
    if cause is FaultCause.OVERRUN:
        return (
            "the loop's ticks still come late, or did a moment ago: each one in time takes one out "
            "of the bucket of loop.overrun_policy, which has to be empty; look at what else needs "
            "the computer (`motorctl latency`), or lower rate_hz"
        )
    return "the axis is still faster than its limit; wait until it has come to rest"


def fault_message(
    cause: FaultCause,
    value: float,
    limit: float,
    time_s: float,
    *,
    period_s: float,
    status: int = 0,
    partner: str = "",
    units: AxisUnits = LINEAR,
) -> str:
    """Return in words what tripped an axis: the cause, its value and its limit.

    Parameters
    ----------
    cause
        Why the axis is in FAULT.
    value, limit
        What tripped and the limit that it passed: m, m/s, or ticks of the axis; by the cause.
    time_s
        When it tripped [s since the first tick].
    period_s
        Period of the axis [s].
    status
        The driver's status word at that time.
    partner
        With PARTNER: the axis that tripped, and why, when, in words; empty where that is not
        known.
    units
        Of the axis.
    """
    if cause is FaultCause.PARTNER and partner:
        return f"partner {partner}"
    if cause is FaultCause.NO_NEW_SAMPLE:
        text = (
            f"no new sample from the device for {_ticks(value, period_s)}; limit {limit:.0f} "
            "(hold_ticks)"
        )
    elif cause is FaultCause.HOST_FROZEN:
        text = (
            f"the loop was stalled for {_ticks(value, period_s)}; limit {_ticks(limit, period_s)}"
            f"{_stall_limit_words(status)}"
        )
    elif cause in _SENTENCES:
        text = _SENTENCES[cause](value, limit, status)
    elif cause in _WITH_LIMIT:
        what, scale, unit = _WITH_LIMIT[cause]
        text = f"{what} {value * scale:.4g} {unit}, limit {limit * scale:.4g} {unit}"
    else:
        text = _WITHOUT_LIMIT[cause]
    text = units.words(text)
    if end := _ENDS.get(status & ENDS):
        text += f", {end} of the beam"
    told = []
    if cause is FaultCause.HOST_FROZEN:
        reported = [said for bit, said in _TROUBLES.items() if status & bit & FAULT_BITS]
        told = [f"since then {said}" for said in reported]
    if cause is FaultCause.AMPLIFIER or told:
        told += _code_words(status)
    if told := told + [words for bit, words in _DEVICE.items() if status & bit]:
        text += f" ({'; '.join(told)})"
    return f"{text}, at {time_s:.3f} s"


def _stall_limit_words(status: int) -> str:
    number = status >> STALL_LIMIT_SHIFT & STALL_LIMIT_MASK
    return f", {_STALL_LIMITS[StallLimit(number)]}" if number else ""


def partner_words(
    index: int,
    statuses: NDArray[np.void],
    names: Sequence[str],
    periods_s: Sequence[float],
    units: Sequence[AxisUnits],
) -> str:
    """Return why the partner tripped that an axis was stopped for; empty for any other fault.

    Parameters
    ----------
    index
        Which axis.
    statuses
        The axes' status records, of `motorctl.loop.layout.axis_status`, shape (axes,).
    names, periods_s, units
        Of all axes, with their periods [s].
    """
    return _partner_words(index, statuses, names, periods_s, units, {index})


def _partner_words(
    index: int,
    statuses: NDArray[np.void],
    names: Sequence[str],
    periods_s: Sequence[float],
    units: Sequence[AxisUnits],
    told: set[int],
) -> str:
    if FaultCause(int(statuses[index]["fault"])) is not FaultCause.PARTNER:
        return ""
    other = int(statuses[index]["fault_value"])
    status, text = statuses[other], f"{names[other]} tripped"
    cause = FaultCause(int(status["fault"]))
    if cause is FaultCause.NONE or other in told:  # it was reset since then
        return f"{text}, at {float(statuses[index]['fault_time_s']):.3f} s"
    why = fault_message(
        cause,
        float(status["fault_value"]),
        float(status["fault_limit"]),
        float(status["fault_time_s"]),
        period_s=periods_s[other],
        status=int(status["fault_status"]),
        partner=_partner_words(other, statuses, names, periods_s, units, told | {other}),
        units=units[other],
    )
    return f"{text}: {why}"


def _ticks(count: float, period_s: float) -> str:
    return f"{count:.0f} ticks ({count * period_s * 1e3:.3g} ms)"
