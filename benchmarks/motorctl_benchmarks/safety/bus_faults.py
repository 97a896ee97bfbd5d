"""The faults of the buses: what the device is ordered to do, and what is no fault of the campaign.

It imports nothing of motorctl, as what is expected of each is reckoned from it apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Options = dict[str, Any]

HOLD_S = 0.15
"""How long an axis may go without a sample: well above the pauses of a busy computer."""
WATCHDOG_S = 0.25
"""The device's own, well above HOLD_S: so it is clear who took the volts away."""
LATE_S = 0.06
RESET_S = 0.05
JUMP_COUNTS = 60_000
"""30 mm: further than four times the top speed in a period of 2 ms, where it is no motion."""
PAUSE_S = 0.09
"""How long the loop's process is stopped: longer than the bucket of late ticks takes, shorter than
the loop may stand still and than an axis goes without a sample."""

WIRE: Mapping[str, tuple[str, Options]] = {
    "silence": ("nothing passes", {"kind": "silence"}),
    "loss": ("every answer vanishes", {"kind": "loss"}),
    "late_answers": ("every answer is 60 ms late", {"kind": "delay", "amount_s": LATE_S}),
    "wrong_length": ("every answer has a wrong length", {"kind": "wrong_length"}),
    "bit_errors": ("every answer has a wrong bit", {"kind": "bit_errors"}),
    "stuck_sequence": (
        "every answer has the same number",
        {"kind": "wrong_sequence", "sequence": "stuck"},
    ),
    "short_reset": (
        "the device starts anew within 50 ms",
        {"kind": "reset", "duration_s": RESET_S},
    ),
    "long_reset": ("the device starts anew within 0.5 s", {"kind": "reset", "duration_s": 0.5}),
    "unplug": ("the line is unplugged", {"kind": "unplug", "duration_s": 1.0}),
    "broken_amplifier": ("an amplifier breaks, and its drive says so", {"kind": "amplifier_fault"}),
    "shifted_count": (
        "the device's count jumps",
        {"kind": "counter_jump", "counts": JUMP_COUNTS},
    ),
}
"""Faults to order of the device at the other end: title and order."""
SLIP_COUNTS = 6_000
"""3 mm: further than a beam's ends may be apart, and no further than one may move in a period."""
SECOND = 1
ENDS: Mapping[str, tuple[str, Options]] = {
    "slipped_end": (
        "the count of one of a beam's two ends slips by 3 mm",
        {"kind": "counter_jump", "channel": SECOND, "counts": SLIP_COUNTS},
    ),
    "lost_end": (
        "one of a beam's two encoders is lost",
        {"kind": "encoder_lost", "channel": SECOND},
    ),
    "broken_end": (
        "one of a beam's two amplifiers breaks, and its drive says so",
        {"kind": "amplifier_fault", "channel": SECOND},
    ),
    "silent_end": (
        "one of a beam's two drives is silent",
        {"kind": "drive_silent", "channel": SECOND},
    ),
}
"""Faults to order of one end of a beam with two motors: title and order."""
ORDERS: Mapping[str, tuple[str, Options]] = {**WIRE, **ENDS}
PAUSE = "host_pause"
COMPUTER: Mapping[str, str] = {PAUSE: "the computer pauses for 90 ms, and ticks are late"}
"""Faults at this end of the wire, by their titles: the loop's process is stopped for a while."""
LOOP_KILLED, BOTH_KILLED = "loop_killed", "both_killed"
KILLS: Mapping[str, str] = {
    LOOP_KILLED: "the loop is killed, and the supervisor disables",
    BOTH_KILLED: "loop and supervisor are killed, and only the device's watchdog is left",
}
"""Processes that are killed at this end, each in a session of its own."""
TITLES: Mapping[str, str] = {
    **{name: title for name, (title, _) in ORDERS.items()},
    **COMPUTER,
    **KILLS,
}

NOT_ORDERED: Mapping[str, str] = {
    "jitter": "a delay that changes; late_answers has it at its longest, all the time",
    "duplicates": "the axis goes on: nothing has to trip",
    "reordering": "the axis goes on: nothing has to trip",
    "babbling": "the axis goes on while samples come: nothing has to trip",
    "counter_wrap": "the count is unwrapped: nothing has to trip",
}
"""Why an order that a device takes is none of WIRE; what becomes of each stands in its page."""
