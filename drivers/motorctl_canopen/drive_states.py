"""States of a CiA 402 drive: read from the statusword, changed by the controlword."""

from __future__ import annotations

from enum import IntEnum


class DriveState(IntEnum):
    """States in the order of CiA 402."""

    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7


NOT_READY, OFF, READY, SWITCHED_ON, OPERATING, QUICK_STOP, FAULT_REACTION, FAULT = map(
    int, DriveState
)
DISABLE_VOLTAGE, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION = 0x00, 0x06, 0x07, 0x0F
FAULT_RESET = 0x80

_STATUS_BITS = 0x6F  # ready, switched on, enabled, fault; no quick stop (inverted); disabled
_QUICK_STOP_BIT = 0x20


def _decode(bits: int) -> int:
    """Return the state that the low bits of a statusword mean."""
    without_quick_stop = bits & ~_QUICK_STOP_BIT
    by_all_bits = {0x21: READY, 0x23: SWITCHED_ON, 0x27: OPERATING, 0x07: QUICK_STOP}
    by_others = {0x40: OFF, 0x0F: FAULT_REACTION, 0x08: FAULT}
    return by_all_bits.get(bits, by_others.get(without_quick_stop, NOT_READY))


_DECODED = bytes(_decode(bits & _STATUS_BITS) for bits in range(128))

ON_THE_WAY_UP = bytes(
    {
        OFF: SHUTDOWN,
        READY: SWITCH_ON,
        SWITCHED_ON: ENABLE_OPERATION,
        OPERATING: ENABLE_OPERATION,
    }.get(state, DISABLE_VOLTAGE)
    for state in range(len(DriveState))
)
"""The controlword that leads from each state towards Operation Enabled."""
AT_REST = bytes(
    SHUTDOWN if state in (OFF, READY, SWITCHED_ON) else DISABLE_VOLTAGE
    for state in range(len(DriveState))
)
"""The controlword that leads from each state towards Ready to Switch On."""


def state_of(statusword: int) -> int:
    """Return the state that a statusword tells, a `DriveState`."""
    return _DECODED[statusword & 0x7F]
