"""What a fault on a bus has to lead to, by line, state and fault, and which are not tried.

It imports nothing of motorctl, as all that is expected is reckoned apart from the loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from motorctl_benchmarks.safety.bus_faults import (
    ENDS,
    HOLD_S,
    LATE_S,
    ORDERS,
    PAUSE,
    RESET_S,
    WATCHDOG_S,
)

OffBy = Literal["command", "watchdog", "device", "ramp"]
"""Who takes the volts away: the loop's command, the device's watchdog, the device as it fails or
was off before, or the loop's command at the end of a ramp."""

CANOPEN = "canopen-udp"
TCP, RTU = "modbus-tcp", "modbus-rtu"
CAN = ("can-udp", "can-slcan")
SERIAL_BEAM, CAN_BEAM = "serial-beam", "can-beam"
CANOPEN_BEAM, MODBUS_BEAM = "canopen-beam", "modbus-beam"
BEAMS = (SERIAL_BEAM, CAN_BEAM, CANOPEN_BEAM, MODBUS_BEAM)
"""Lines with a beam that two motors drive at their other end."""
STATES = ("shuttle", "hold", "off", "stop", "homing", "cruise")
"""What both axes do when the fault comes: move back and forth, rest under power, rest without,
ramp down as they were told to, look for their home switch, move at a constant speed."""

_CHECKSUM = (
    "the line's own checksum lets no wrong bit pass, so the order would be a device that sends "
    "wrong content, of which nobody can promise anything"
)
NOT_TRIED: Mapping[tuple[str, str], str] = {
    ("can-udp", "bit_errors"): _CHECKSUM,
    ("can-slcan", "bit_errors"): _CHECKSUM,
    (CANOPEN, "bit_errors"): _CHECKSUM,
    (TCP, "bit_errors"): _CHECKSUM,
    (TCP, "wrong_length"): "it may cost the stream its step, or not: there are two promises",
    (CANOPEN, "stuck_sequence"): "a PDO has no number that could stand still",
    (SERIAL_BEAM, "silent_end"): "one STATE of the box has both ends",
    (MODBUS_BEAM, "silent_end"): "one reply of the coupler has both ends",
    (RTU, "shifted_count"): (
        "in a period of 8 ms a jump of 30 mm may be motion, for all that a guard knows"
    ),
}
"""Why a fault is not tried on a line, in any state. Every other pair is."""
_IN_VIRTUAL_TIME = "a ramp has its length from a constant speed; virtual time has every state"
NOT_MET: Mapping[tuple[str, str], str] = {
    **{(PAUSE, state): _IN_VIRTUAL_TIME for state in STATES if state != "cruise"},
    **{(fault, "cruise"): "shuttle has most of its way at a constant speed" for fault in ORDERS},
    **{
        (fault, state): "virtual time has every state of a beam"
        for fault in ENDS
        for state in STATES
        if state not in ("shuttle", "cruise")
    },
}
"""Why a fault is not tried in a state, on any line."""

SHARED_S = 2e-3
"""Of the wire's time everywhere: two processes of this computer, and what the kernel has between
them. By hand."""
SUPERVISOR_S = 1.0
"""From the loop's death until its supervisor has switched the outputs off: it looks for the loop
many times a second, makes each driver anew and tells it to disable."""
COMMAND_TICKS: Mapping[str, int] = {
    CANOPEN: 2,  # a command waits for the next SYNC
    RTU: 3,  # a request without a reply is waited for, and the next begins with a new period
}
"""Periods from a command's tick until it acts at the latest; elsewhere 1."""
HEARTBEATS_A_WATCHDOG = 4
"""Sent within the watchdog's time of a drive on CANopen, which waits for heartbeats and no command.
By definition, as docs/drivers/canopen.md promises."""


@dataclass(frozen=True)
class Promise:
    """What a fault must lead to."""

    guard: str
    """The cause; empty: nothing may trip."""
    off_s: float
    """From its begin until the device's amplifiers are off; with a ramp nobody asks."""
    held: bool = True
    """The axis goes on for the allowed ticks first."""
    asked: bool = False
    """A reset (of an axis that is off: a start) is asked for while it lasts, and has to be refused.
    """
    off_by: OffBy = "command"
    passes: bool = False
    """An answer that is hit is now and then as good as a new one: times count from the last."""
    told_reset: bool = False
    """Of an axis that is off: a start is refused until a reset has opened the driver anew, or has
    had the device forget its fault."""


def is_possible(line: str, state: str, fault: str) -> bool:
    """Return whether a case is tried: there is no reason against it.

    A beam meets what its two ends may do apart; what a whole wire may do the gantry has met.
    """
    if (line in BEAMS) is not (fault in ENDS):
        return False
    return (line, fault) not in NOT_TRIED and (fault, state) not in NOT_MET


def promise(line: str, state: str, fault: str) -> Promise | None:
    """Return what a fault must lead to; None where it is not tried.

    What an axis with power does makes no difference to what the guards of the wire see: the same
    guard, after the same time. On CAN an answer that is late, or whose number stands still, passes
    for a new one about once in a hundred ticks; a reset may be obeyed then, and is not asked for.
    Nor is it where it would open the driver anew: on CANopen after three heartbeats that are
    missing.
    """
    if not is_possible(line, state, fault):
        return None
    return _off(line, fault) if state == "off" else _powered(line, fault)


def _powered(line: str, fault: str) -> Promise:
    if fault == PAUSE:
        return Promise("overrun", 0.0, held=False, off_by="ramp")
    if fault == "broken_amplifier":
        # The drives of CANopen are reset, and fail again: a fault that ends meanwhile is gone.
        asked = line != CANOPEN
        return Promise("amplifier", 0.0, held=False, asked=asked, off_by="device")
    if fault in ENDS:
        return _one_end(line, fault)
    if fault == "shifted_count":
        return Promise("encoder_jump", 0.0, held=False)
    if fault in ("silence", "unplug"):
        # The device hears nothing either: its watchdog takes the volts.
        gone = fault == "unplug" and _has_port(line)
        guard = "communication" if gone else "no_new_sample"
        asked = fault == "silence" and line != CANOPEN
        return Promise(guard, WATCHDOG_S, not gone, asked=asked, off_by="watchdog")
    if fault.endswith("reset"):
        if line == TCP:  # the connection is reset with it
            off_s = RESET_S if fault == "short_reset" else 0.0
            return Promise("communication", off_s, held=False, off_by="device")
        if fault == "short_reset":
            return Promise("encoder_lost", RESET_S, held=False, off_by="device")
        return Promise("no_new_sample", 0.0, off_by="device")
    late_s = LATE_S if fault == "late_answers" else 0.0
    asked = not _passes(line, fault) and line != CANOPEN
    return Promise("no_new_sample", HOLD_S + late_s, asked=asked, passes=_passes(line, fault))


def _one_end(line: str, fault: str) -> Promise:
    """Both motors are let go, whichever end it came from.

    A drive of CANopen that has lost its encoder goes into Fault, as with any trouble of its own.
    """
    asked = line != CANOPEN_BEAM
    if fault == "slipped_end":
        return Promise("skew", 0.0, held=False)
    if fault == "lost_end" and line != CANOPEN_BEAM:
        return Promise("encoder_lost", 0.0, held=False, asked=asked)
    if fault in ("lost_end", "broken_end"):  # the other motor is the loop's to switch off
        return Promise("amplifier", 0.0, held=False, asked=asked)
    return Promise("no_new_sample", HOLD_S, asked=asked)


def _off(line: str, fault: str) -> Promise:
    """Nothing trips without power; a start is refused while nothing, or a fault, is reported.

    A count that jumps at rest without power is the place where the axis stands.
    """
    silent = ("silence", "unplug", "loss", "wrong_length")
    told_reset = (
        fault.endswith("reset")
        or (fault == "unplug" and _has_port(line))
        # Three heartbeats are missing, or the drive keeps its fault until it is told to forget it.
        or (line == CANOPEN and fault in (*silent, "broken_amplifier"))
    )
    asked = fault != "shifted_count" and not _passes(line, fault)
    return Promise("", 0.0, held=False, asked=asked, off_by="device", told_reset=told_reset)


def _has_port(line: str) -> bool:
    """Return whether the line is a port or a connection, whose end the driver is told of."""
    return line not in ("can-udp", CANOPEN)


def _passes(line: str, fault: str) -> bool:
    """Return whether an answer that is hit is now and then as good as a new one.

    On serial lines a byte more is the byte that ends a message, once in 512.
    """
    if line.startswith("serial") and fault == "wrong_length":
        return True
    return line.startswith("can") and fault in ("late_answers", "stuck_sequence")


def command_s(line: str, period_s: float) -> float:
    """Return how long after its tick a command acts at the device, at the latest."""
    return COMMAND_TICKS.get(line, 1) * period_s + SHARED_S


def fed_s(line: str, watchdog_s: float) -> float:
    """Return how far apart the messages that feed a device's watchdog are, beyond a command's.

    Elsewhere every command feeds it.
    """
    return watchdog_s / HEARTBEATS_A_WATCHDOG if line.startswith("canopen") else 0.0


def ramp_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> tuple[float, float]:
    """Return how long a ramp to rest takes with these limits, at least and at most.

    At least where the axis brakes already as hard as it may and need not end that gently, at most
    where it comes from a constant speed.
    """
    speed = abs(speed_m_s)
    least = speed / acceleration_m_s2
    if speed * jerk_m_s3 <= acceleration_m_s2**2:  # it never comes to its full acceleration
        return least, float(2.0 * (speed / jerk_m_s3) ** 0.5)
    return least, least + acceleration_m_s2 / jerk_m_s3
