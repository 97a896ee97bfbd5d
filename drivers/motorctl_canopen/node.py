"""One drive in the loop: what it told last, what it is told next, and what is wrong with it."""

from __future__ import annotations

import math
import struct

import can

from motorctl.hal import (
    DISABLE_LATE,
    ENABLE_LATE,
    LEFT_OPERATION,
    Channel,
    Status,
    error_bits,
)
from motorctl_canopen import objects
from motorctl_canopen.drive_states import (
    AT_REST,
    DISABLE_VOLTAGE,
    FAULT,
    FAULT_REACTION,
    FAULT_RESET,
    NOT_READY,
    OFF,
    ON_THE_WAY_UP,
    OPERATING,
    state_of,
)
from motorctl_canopen.options import NodeOptions

STATE_FRAME = struct.Struct("<Hi")
INPUTS_FRAME = struct.Struct("<I")
COMMAND_FRAME = struct.Struct("<Hh")
EMCY_FRAME = struct.Struct("<HB5x")
MOST_TORQUE = 32767
CLEARING_S = 0.5
"""How long the bit that resets a fault is held at most."""

STALE, CORRUPT = int(Status.STALE), int(Status.CORRUPT)
UNPOWERED = int(Status.UNPOWERED)
LOST = int(Status.COMMUNICATION_LOST)
AMPLIFIER_FAULT = int(Status.AMPLIFIER_FAULT)
RESTARTED = int(Status.DEVICE_RESTARTED | Status.ENCODER_LOST)
SWITCHES = {
    "limit_negative": int(Status.LIMIT_NEGATIVE),
    "limit_positive": int(Status.LIMIT_POSITIVE),
    "home_switch": int(Status.HOME_SWITCH),
}
STATE, INPUTS = 1, 2
"""Bits of what a node answers to SYNC."""


class Node:
    """A drive's newest words. `take_...` are called for its frames, `status` and `command` once a
    period."""

    def __init__(
        self,
        options: NodeOptions,
        channel: Channel,
        period_s: float,
        enable_timeout_s: float,
        silence_s: float,
    ) -> None:
        self.number = options.node
        self.axis = channel.axis
        self.asked = STATE | (INPUTS if options.inputs else 0)
        self._permille_per_v = 1000.0 / options.rated_torque_v
        self._enable_periods = max(1, math.ceil(enable_timeout_s / period_s))
        self._clear_periods = max(2, math.ceil(CLEARING_S / period_s))
        self._silence_s = silence_s
        given = options.inputs
        self._switches = tuple(
            (1 << bit, SWITCHES[name]) for name, bit in (given.named() if given else {}).items()
        )
        self._inverted = 0xFFFFFFFF if given is not None and given.inverted else 0
        self.message = can.Message(
            arbitration_id=objects.RPDO1_ID + self.number,
            is_extended_id=False,
            data=bytearray(COMMAND_FRAME.size),
            is_rx=False,
        )
        self.forget()

    def forget(self) -> None:
        """Begin as before the first frame."""
        self.position = self.shown = 0
        self.drive = NOT_READY
        self.inputs = 0
        self.error_code = 0
        self.nmt = objects.PRE_OPERATIONAL
        self.booted = False
        self.known = False
        self.heard_s = 0.0
        self.missing = self.asked
        """What has not been answered since the last SYNC."""
        self.forget_owed()
        self.refused = False
        self._latched = 0
        self._own_fault = 0
        self._operated = False
        self._going_off = False
        self._clearing = 0
        self._enabling = 0
        self._disabling = 0
        self.was_enabled = False
        self.to_start = False
        """It is to be started by network management."""

    def forget_owed(self) -> None:
        """Let no answer be owed to SYNCs of before."""
        self._owed_states = self._owed_inputs = 0
        self._came = 0
        self.doubted = False
        """What came last may answer an older SYNC than it seems to."""

    @property
    def owed(self) -> int:
        """How many answers of a kind, at most, are still to come, or lost."""
        return max(self._owed_states, self._owed_inputs)

    def begin(self, now_s: float) -> None:
        """Begin the first period: the drive was heard just now, and its position is known."""
        self.heard_s, self.shown = now_s, self.position
        self.booted = False

    # Frames that came.

    def take_state(self, data: bytearray) -> bool:
        """Take statusword and position; False: the frame has another length."""
        if len(data) != STATE_FRAME.size:
            self.refused = True
            return False
        word, self.position = STATE_FRAME.unpack_from(data)
        self.drive = state_of(word)
        self.known = True
        return True

    def take_inputs(self, data: bytearray) -> bool:
        """Take the digital inputs; False: the frame has another length."""
        if len(data) != INPUTS_FRAME.size:
            self.refused = True
            return False
        (self.inputs,) = INPUTS_FRAME.unpack_from(data)
        return True

    def take_emergency(self, data: bytearray) -> None:
        """Take an emergency message: its code stands until the next one."""
        if len(data) != EMCY_FRAME.size:
            self.refused = True
            return
        code, _register = EMCY_FRAME.unpack_from(data)
        self.error_code = code if code & 0xFF00 else 0  # 00xxh: it is over

    def take_heartbeat(self, data: bytearray, now_s: float) -> None:
        """Take a heartbeat, or the message that a node sends once it has started."""
        if len(data) != 1:
            self.refused = True
            return
        self.nmt = data[0] & 0x7F
        self.heard_s = now_s
        if self.nmt == objects.BOOT_UP:
            self.booted = True

    # Answers to SYNCs of earlier periods, which come late or never.

    def next_period(self, asked: bool, silent: bool) -> None:
        """Count what the last period's SYNC, if there was one, is still to be answered with.

        What comes from now on counts for a silence, unless one is under way already.
        """
        if asked:
            self._owed_states += self.missing & STATE
            self._owed_inputs += (self.missing & INPUTS) >> 1
        self.missing = 0
        if not silent:
            self._came = 0

    def takes_owed(self, bit: int) -> bool:
        """Take a frame for the oldest answer that is owed; False: none is."""
        self._came |= bit
        if bit == STATE and self._owed_states:
            self._owed_states -= 1
            return True
        if bit == INPUTS and self._owed_inputs:
            self._owed_inputs -= 1
            return True
        return False

    @property
    def came(self) -> bool:
        """Whether every kind of answer has come since the silence began."""
        return self._came == self.asked

    def judge_silence(self) -> bool:
        """Let what did not come in a silence be owed no more, as it was lost; tell if any came."""
        if not self._came & STATE:
            self._owed_states = 0
        if not self._came & INPUTS:
            self._owed_inputs = 0
        self.doubted = False
        return bool(self._came)

    # Once a period.

    def status(self, asked_s: float) -> int:
        """Return the status word of this period, and let the next one begin.

        What came before `asked_s` has been taken.
        """
        word = 0
        if self._operated and self.drive != OPERATING:
            # It was told to go on: whatever state it is in, it has a reason of its own.
            self._give_up(LEFT_OPERATION)
        if self.missing:
            word |= STALE
        else:
            self.shown = self.position
        if self.drive != OPERATING:
            word |= UNPOWERED
        if self.refused:
            word |= CORRUPT
            self.refused = False
        silent = asked_s - self.heard_s > self._silence_s
        if self.booted or silent:
            self._latched |= RESTARTED  # after such a silence nobody knows
        if silent or self.nmt != objects.OPERATIONAL:
            word |= LOST
        if self.drive in (FAULT, FAULT_REACTION):
            word |= AMPLIFIER_FAULT | error_bits(self.error_code)
        elif self._own_fault:
            word |= AMPLIFIER_FAULT | error_bits(self._own_fault)
        inputs = self.inputs ^ self._inverted
        for bit, told in self._switches:
            if inputs & bit:
                word |= told
        return word | self._latched

    def command(self, volts: float, enable: bool) -> None:
        """Write the next command frame: the controlword that leads on, and the torque."""
        torque = 0
        drive = self.drive
        if enable and math.isfinite(volts) and not self._own_fault and not self._going_off:
            word = self._up(drive)
            if word and drive == OPERATING:
                asked = volts * self._permille_per_v
                torque = round(min(max(asked, -MOST_TORQUE), MOST_TORQUE))
        else:
            word = self._down(drive, bool(enable))
        COMMAND_FRAME.pack_into(self.message.data, 0, word, torque)

    def _up(self, drive: int) -> int:
        if drive == OPERATING:
            self._operated = True
            return ON_THE_WAY_UP[drive]
        self._enabling += 1
        if self._enabling > self._enable_periods:
            self._give_up(ENABLE_LATE)
            return DISABLE_VOLTAGE
        return ON_THE_WAY_UP[drive]

    def _give_up(self, kind: int) -> None:
        """Fault the drive for the state that it is in, and switch it off."""
        self._own_fault = kind + self.drive
        self._operated, self._enabling, self._going_off = False, 0, True

    def _down(self, drive: int, enable: bool) -> int:
        if self._operated or self._enabling or drive == OPERATING:
            self._going_off = True
        self._operated, self._enabling = False, 0
        if not enable and not self._going_off:
            self._own_fault = 0
        if self._going_off and drive in (NOT_READY, OFF, FAULT, FAULT_REACTION):
            self._going_off = False
        if not self._going_off:
            self._disabling = 0
        elif not self.missing & STATE:
            self._disabling += 1
            if self._disabling > self._enable_periods and not self._own_fault:
                self._own_fault = DISABLE_LATE + drive
        if self._clearing and drive in (FAULT, FAULT_REACTION) and not enable:
            self._clearing -= 1
            return FAULT_RESET if drive == FAULT else DISABLE_VOLTAGE
        self._clearing = 0
        return DISABLE_VOLTAGE if self._going_off or enable else AT_REST[drive]

    def switch_off(self) -> None:
        """Write a command frame that disables, whatever the drive's state."""
        self._operated, self._enabling, self._going_off = False, 0, True
        COMMAND_FRAME.pack_into(self.message.data, 0, DISABLE_VOLTAGE, 0)

    def clear_fault(self) -> None:
        """Let the next commands reset the drive's fault, while it is disabled."""
        self._clearing = self._clear_periods
        self.to_start = self.nmt != objects.OPERATIONAL
