"""Say what a person does next about an axis in the state FAULT, cause by cause."""

from __future__ import annotations

from motorctl.hal import Status
from motorctl.log.sample import FaultCause
from motorctl.loop.axis_records import STALL_LIMIT_MASK, STALL_LIMIT_SHIFT, StallLimit

_SEEN = "`motorctl fault show --out pictures` draws its last seconds"
_COMPUTER = "`motorctl latency` measures this computer, and says what to change"
_STEPS = {
    FaultCause.FOLLOWING_ERROR: (
        f"{_SEEN}: look for a blocked way, a command at its limit, a loop that oscillates (lower "
        "the gains), or a gain or a limit (limits.following_error) that is too small"
    ),
    FaultCause.SOFT_LIMIT: (
        "after the reset move it back into limits.travel_m; look for what pushed it out, or for a "
        "zero that is wrong"
    ),
    FaultCause.OVERSPEED: (
        f"{_SEEN}: one that runs away has encoder.direction or the polarity of its motor wrong; "
        "else limits.max_velocity_m_s is too small for its motion"
    ),
    FaultCause.NOT_A_NUMBER: (
        "look for a learned parameter without a value in `motorctl status {axis}`; a new start of "
        "the daemon begins with the saved or the configured ones"
    ),
    FaultCause.ENCODER_LOST: "check the encoder's cable, plug and supply",
    FaultCause.ENCODER_JUMP: (
        "check the encoder's cable, shield and head, and that encoder.resolution_m and "
        "counter_bits are the device's"
    ),
    FaultCause.AMPLIFIER: "read at the amplifier what it reports, and mend that",
    FaultCause.COMMUNICATION: (
        "check the device's supply, its cable and its bus; `motorctl status {axis}` tells what the "
        "driver reports now"
    ),
    FaultCause.ESTOP: "see that the machine may move again",
    FaultCause.LIMIT_SWITCH: (
        "after the reset move it back from the switch; one that is pressed within limits.travel_m "
        "tells of a zero that is wrong"
    ),
    FaultCause.HOMING_FAILED: (
        "see that the position in `motorctl status {axis}` changes while it searches, that "
        "homing.search_velocity_m_s leads towards the switch, and that homing.timeout_s is enough "
        "for the way"
    ),
    FaultCause.OVERRUN: _COMPUTER,
    FaultCause.HOST_FROZEN: _COMPUTER,
    FaultCause.SUPERVISOR_LOST: (
        "read in the daemon's journal whether it was ended or hung; on a busy computer "
        "loop.supervisor_timeout_s lets it be silent for longer"
    ),
    FaultCause.NO_NEW_SAMPLE: (
        "check the device's cable and its bus, and the bus' budget in `motorctl check`; "
        "late.hold_ticks lets it be late for longer"
    ),
    FaultCause.PARTNER: "mend that first; each axis is reset by itself",
    FaultCause.ENCODER_STUCK: (
        "push it by hand while it is off: where the count follows in `motorctl status {axis}`, its "
        "way is blocked; where not, check the encoder's cable and head"
    ),
    FaultCause.ENCODER_NOISE: "check the encoder's cable, shield and head",
    FaultCause.SATURATION: (
        f"{_SEEN}: look for a blocked way, too large a load or a loop that oscillates (gains), or "
        "ask for less acceleration"
    ),
    FaultCause.THERMAL: (
        "let the motor cool down, for a part of guards.thermal.time_constant_s; then a gentler "
        "motion, or longer rests"
    ),
    FaultCause.SKEW: (
        "look for what holds one end back; `motorctl start {axis}` then leads the beam to square"
    ),
    FaultCause.NOT_SQUARE: (
        "look at the switches or marks of both ends, and square the beam by hand where it is "
        "askew; dual_drive.square_offset_m says how far they lie apart where it is square"
    ),
}
"""What to look at, and to do, before the reset."""
_LOSES_PLACE = (
    FaultCause.ENCODER_LOST,
    FaultCause.ENCODER_JUMP,
    FaultCause.COMMUNICATION,
    FaultCause.HOMING_FAILED,
    FaultCause.OVERRUN,
    FaultCause.HOST_FROZEN,
    FaultCause.NO_NEW_SAMPLE,
    FaultCause.NOT_SQUARE,
)
"""Causes after which an axis may not know its place any more."""


def next_step(
    cause: FaultCause,
    axis: str,
    *,
    status: int = 0,
    hidden_turns: bool = False,
    on_switch: bool = False,
    homed: bool = True,
) -> str:
    """Return in words what to do about a fault before its reset.

    Parameters
    ----------
    cause
        Why the axis is in FAULT.
    axis
        Its name.
    status
        The driver's status word at that time, with which limit a pause of the loop was beyond.
    hidden_turns
        With ENCODER_JUMP: no step was too large, but whole turns may be hidden in it.
    on_switch
        With HOMING_FAILED: it ran onto a limit switch, or stood on it.
    homed
        Whether the axis knows its place.
    """
    step = _STEPS[cause].format(axis=axis)
    if cause is FaultCause.ESTOP and status & Status.ESTOP:
        step = f"release the hardware's emergency stop, and {step}"
    if cause is FaultCause.HOMING_FAILED and on_switch:
        step = (
            "push it off the limit switch by hand while it is off, and see that the search and the "
            "latch (homing.search_velocity_m_s, latch_velocity_m_s) lead away from it"
        )
    if cause is FaultCause.ENCODER_JUMP and hidden_turns:
        step = (
            "look for why no sample came, at the device and its bus; more encoder.counter_bits "
            "stand longer gaps"
        )
    if cause is FaultCause.HOST_FROZEN and _stall_limit(status) == StallLimit.COUNTER:
        step += "; the encoder is in order, and more encoder.counter_bits stand longer pauses"
    if cause in _LOSES_PLACE and not homed:
        step += f"; it does not know its place: `motorctl home {axis}` after the reset"
    return step


def _stall_limit(status: int) -> int:
    return status >> STALL_LIMIT_SHIFT & STALL_LIMIT_MASK
