"""The process of a device: from its file to its report."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from motorctl.gantry_device.device import Device
from motorctl.gantry_device.load import load_device

PRIORITY = 70
"""Below the loop's own, which may share the machine."""
MCL_CURRENT, MCL_FUTURE = 1, 2


def run_device(path: Path, link: Path | None, ready: Callable[[str], None]) -> dict[str, Any]:
    """Serve the device of a file until SIGINT or SIGTERM, and give its report.

    `ready` is told the endpoint once the device answers. Raises ConfigError, UsageError and
    RunError.
    """
    device = load_device(path, link)
    device.open()
    ask_for_priority()
    before = {
        number: signal.signal(number, lambda *_: device.stop())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        gc.collect()
        gc.freeze()
        gc.disable()
        ready(device.endpoint.address)
        device.run()
        return report(device)
    finally:
        gc.enable()
        gc.unfreeze()
        device.close()
        for number, handler in before.items():
            signal.signal(number, handler)


def ask_for_priority() -> None:
    """Ask for a real-time priority and locked memory, as firmware has them; go on without."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE)


def report(device: Device) -> dict[str, Any]:
    """Tell what a device did, as plain data."""
    machine, endpoint = device.machine, device.endpoint
    return {
        "endpoint": endpoint.address,
        "exchanges": endpoint.exchanges,
        "samples": machine.samples,
        "commands": machine.commands,
        "refused": endpoint.refused,
        "watchdog_trips": machine.watchdog_trips,
        "restarts": machine.restarts,
        "faults": [
            {"kind": f.order.kind, "at_s": f.order.at_s, "fired": f.fired}
            for f in device.schedule.faults
        ],
        "travelled_counts": machine.travelled_counts(),
    }
