"""Say in words why an axis is in the state FAULT."""

from __future__ import annotations

from motorctl.hal import Status
from motorctl.log.sample import FaultCause

_WITH_LIMIT = {
    FaultCause.FOLLOWING_ERROR: ("following error", 1e3, "mm"),
    FaultCause.SOFT_LIMIT: ("position beyond the soft limit:", 1e3, "mm"),
    FaultCause.OVERSPEED: ("speed", 1.0, "m/s"),
}
_WITHOUT_LIMIT = {
    FaultCause.NOT_A_NUMBER: "the control law gave no finite command",
    FaultCause.ENCODER_LOST: "the encoder's signal is lost",
    FaultCause.ENCODER_JUMP: "the encoder's count jumped further than the axis can move",
    FaultCause.AMPLIFIER: "the amplifier reports a fault",
    FaultCause.COMMUNICATION: "communication with the device is lost",
    FaultCause.ESTOP: "emergency stop",
    FaultCause.LIMIT_SWITCH: "a limit switch was reached",
    FaultCause.HOMING_FAILED: "homing failed: no switch or index mark within its timeout",
    FaultCause.OVERRUN: "too many overruns of the control period",
    FaultCause.SUPERVISOR_LOST: "the supervisor fell silent",
}

_DEVICE = {
    Status.BUS_OFF: "the bus or the port is gone",
    Status.DEVICE_RESTARTED: "the device began anew",
    Status.CORRUPT: "what came was refused (checksum, length or sequence), or the bus had no room",
}
"""What a driver may add to the cause."""
_TROUBLES = {
    Status.ENCODER_LOST: _WITHOUT_LIMIT[FaultCause.ENCODER_LOST],
    Status.AMPLIFIER_FAULT: _WITHOUT_LIMIT[FaultCause.AMPLIFIER],
    Status.COMMUNICATION_LOST: _WITHOUT_LIMIT[FaultCause.COMMUNICATION],
    Status.ESTOP: _WITHOUT_LIMIT[FaultCause.ESTOP],
    Status.STALE: "no new sample comes",
}
_UNTIL_OPENED = Status.BUS_OFF | Status.DEVICE_RESTARTED
"""What mostly stays until the driver is opened anew, which it is when the daemon starts."""


def device_message(status: int) -> str:
    """Say what a driver reports that keeps an axis from being started; '' where it is nothing."""
    told = "; ".join(words for bit, words in (_TROUBLES | _DEVICE).items() if status & bit)
    if status & _UNTIL_OPENED:
        told += "; if it stays so, restart the daemon, which opens the device anew"
    return told


def fault_message(
    cause: FaultCause, value: float, limit: float, time_s: float, status: int = 0
) -> str:
    """Name the cause with its value, its limit and when it was [s since the first tick].

    status is the driver's word at that time.
    """
    if cause is FaultCause.NO_NEW_SAMPLE:
        text = f"no new sample from the device for {value:.0f} ticks, {limit:.0f} are allowed"
    elif cause is FaultCause.OVERRUN and value > 0.0:
        text = (
            f"this computer did not run the loop for {value:.0f} ticks of the axis at once, "
            f"{limit:.0f} without a sample are allowed"
        )
    elif cause in _WITH_LIMIT:
        what, scale, unit = _WITH_LIMIT[cause]
        text = f"{what} {value * scale:.4g} {unit}, limit {limit * scale:.4g} {unit}"
    else:
        text = _WITHOUT_LIMIT[cause]
    if told := [words for bit, words in _DEVICE.items() if status & bit]:
        text += f" ({'; '.join(told)})"
    return f"{text}, at {time_s:.3f} s"
