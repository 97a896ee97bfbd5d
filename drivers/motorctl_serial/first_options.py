"""With what the configuration of a new box on a serial line begins."""

from __future__ import annotations

from collections.abc import Sequence

from motorctl.hal import FirstAxis, FirstOptions

WATCHDOG_S, WATCHDOG_PERIODS = 0.02, 10
"""The box disables after so long without a command: the protocol's usual time, and no less than
ten periods."""


def first_options(axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
    """Return a box at a USB adapter, one exchange a period."""
    return FirstOptions(
        {
            "port": "/dev/ttyUSB0",
            "baud": 921600,
            "mode": "exchange",
            "watchdog_s": max(WATCHDOG_S, round(WATCHDOG_PERIODS * period_s, 3)),
            "late": {"hold_ticks": 3, "predict": True},
        },
        {
            ("mode",): "each write asks for the next read's sample: nothing is waited for",
            ("watchdog_s",): "the box disables by itself after so long without a command",
            ("late",): "ticks without a new sample: the model stands in",
        },
        ("port: the terminal of the box, best by /dev/serial/by-id/", "baud: as the box is set"),
    )
