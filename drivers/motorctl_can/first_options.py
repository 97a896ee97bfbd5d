"""With what the configuration of new amplifiers on CAN begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorctl.hal import FirstAxis, FirstOptions

SYNC_ID, COMMAND_ID, STATE_ID = 0x80, 0x200, 0x180
"""Identifiers as CANopen has them; those of an axis are so much and its channel's number."""
VOLT_STEPS = 32000
"""Steps of the command's word of 16 bits up to the full command, a round number below 2^15."""
WAIT_SHARE = 0.6
"""Of the period, for the answers to SYNC: the loop may wait for 0.8 of it."""
WATCHDOG_S, WATCHDOG_PERIODS = 0.05, 10
"""The device disables after so long without a command; ten periods are enough for late ones."""
FLAGS = (
    "encoder_lost",
    "amplifier_fault",
    "limit_negative",
    "limit_positive",
    "home_switch",
    "estop",
)


def first_options(axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
    """Return a layout with a command and a state frame for each axis, with SYNC."""
    frames: dict[str, Any] = {}
    for axis in axes:
        of_axis = {"axis": axis.name}
        scale = float(f"{axis.max_voltage_v / VOLT_STEPS:.8g}")
        volts = {"means": "volts", **of_axis, "start": 0, "bits": 16, "signed": True}
        frames[f"command_{axis.name}"] = {
            "id": COMMAND_ID + axis.channel,
            "direction": "command",
            "length": 6,
            "signals": {
                "volts": {**volts, "scale": scale},
                "enable": {"means": "enable", **of_axis, "start": 16, "bits": 1},
                "sequence": {"means": "sequence", "start": 24, "bits": 8},
                "watchdog": {"means": "watchdog", "start": 32, "bits": 16, "scale": 0.001},
            },
        }
        bits, after = axis.counter_bits, 8 * -(-axis.counter_bits // 8)
        counts = {"means": "counts", **of_axis, "start": 0, "bits": bits, "signed": True}
        flags = {
            name: {"means": name, **of_axis, "start": after + 8 + number, "bits": 1}
            for number, name in enumerate(FLAGS)
        }
        frames[f"state_{axis.name}"] = {
            "id": STATE_ID + axis.channel,
            "direction": "state",
            "length": after // 8 + 3,
            "signals": {
                "counts": counts,
                "sequence": {"means": "sequence", "start": after, "bits": 8},
                **flags,
                "boot": {"means": "boot", **of_axis, "start": after + 16, "bits": 8},
            },
        }
    options = {
        "interface": "socketcan",
        "channel": "can0",
        "bitrate": 1000000,
        "sync": {"id": SYNC_ID, "wait_s": float(f"{WAIT_SHARE * period_s:.3g}")},
        "watchdog_s": max(WATCHDOG_S, round(WATCHDOG_PERIODS * period_s, 3)),
        "frames": frames,
        "late": {"hold_ticks": 3, "predict": True},
    }
    return FirstOptions(
        options,
        {
            ("sync",): "the device samples when SYNC comes; 0.6 periods are left for the answers",
            ("watchdog_s",): "the device disables by itself after so long without a command",
            ("frames",): "a guess, of the shape that docs/drivers/can.md explains",
            ("late",): "ticks without a new sample: the model stands in",
        },
        (
            "frames: the layout of your device, or dbc and signals in its place",
            "channel: the CAN interface, and bitrate as the devices are set",
        ),
    )
