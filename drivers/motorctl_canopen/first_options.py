"""With what the configuration of new drives on CANopen begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorctl.hal import FirstAxis, FirstOptions

WAIT_SHARE = 0.6
"""Of the period, for the drives' answers: the loop may wait for 0.8 of it."""
WATCHDOG_S, WATCHDOG_PERIODS = 0.1, 10
"""A drive that hears nothing for so long goes into Fault: two such times of the usual one are what
people bear to see, and ten periods are enough for heartbeats that come late."""

SWITCHES = {"limit_negative": 0, "limit_positive": 1, "home_switch": 2}
"""Bits of the digital inputs (60FDh), as CiA 402 has them."""


def first_options(axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
    """Return drives by the numbers of their channels, whose rated torque is the full command."""
    nodes: dict[str, Any] = {
        axis.name: {"node": axis.channel + 1, "rated_torque_v": axis.max_voltage_v}
        | ({"inputs": dict(SWITCHES)} if axis.homing.startswith("switch") else {})
        for axis in axes
    }
    options = {
        "interface": "socketcan",
        "channel": "can0",
        "bitrate": 1000000,
        "sync": {"wait_s": float(f"{WAIT_SHARE * period_s:.3g}")},
        "command_at": "sync",
        "watchdog_s": max(WATCHDOG_S, WATCHDOG_PERIODS * period_s),
        "nodes": nodes,
        "late": {"hold_ticks": 3, "predict": True},
    }
    told: dict[tuple[str | int, ...], str] = {
        ("sync",): "how long a read waits for the drives' answers: 0.6 periods",
        ("command_at",): "a command acts with the next SYNC, one period late",
        ("watchdog_s",): "a drive that hears no heartbeat for so long goes into Fault",
        ("late",): "ticks without a new sample: the model stands in",
    }
    return FirstOptions(
        options,
        told,
        (
            "channel: the CAN interface, and bitrate as the drives are set",
            *(f"nodes.{axis.name}.node: the drive's number on the bus" for axis in axes),
            *(
                f"nodes.{axis.name}.rated_torque_v: the command that is sent as the drive's rated "
                "torque (6076h)"
                for axis in axes
            ),
        ),
    )
