"""With what the configuration of a new coupler on Modbus begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorctl.hal import FirstAxis, FirstOptions

FULL_COUNT = 32767
"""What an output word of 16 bits gives the full command at: by definition of two's complement."""
SWITCHES = ("encoder_lost", "amplifier_fault", "limit_negative", "limit_positive", "estop")


def first_options(axes: Sequence[FirstAxis]) -> FirstOptions:
    """Return a coupler on TCP whose registers follow each other in the order of the channels."""
    numbers = len(axes)
    channels: dict[int, Any] = {}
    for place, axis in enumerate(axes):
        status = {
            name: {"address": 2 * numbers + place, "bit": bit}
            for bit, name in enumerate((*SWITCHES, "home_switch"))
        }
        channels[axis.channel] = {
            "volts": {
                "address": place,
                "bits": 16,
                "volts_per_count": float(f"{axis.max_voltage_v / FULL_COUNT:.8g}"),
            },
            "enable": {"address": numbers, "bit": place},
            "counts": {"address": 2 * place, "bits": axis.counter_bits},
            "status": status,
        }
    options = {
        "tcp": {"host": "192.168.0.10", "port": 502},
        "device_turnaround_s": 0.5e-3,
        "sequence": {"output": numbers + 1, "input": 3 * numbers},
        "channels": channels,
        "late": {"hold_ticks": 3, "predict": True},
    }
    return FirstOptions(
        options,
        {
            ("sequence",): "shows which request a reply answers; remove it where the device cannot",
            ("device_turnaround_s",): "from a request's end to its reply: the highest rate",
            ("late",): "ticks without a new sample: the model stands in",
        },
        (
            "tcp.host: the address of the coupler",
            "channels: the registers of each axis; they follow each other as a guess",
            "device_turnaround_s: see the coupler's manual, often 1 ms",
        ),
    )
