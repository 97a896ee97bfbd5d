"""The process of a device: from its file to its report."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

from motorctl_devices.device import Device
from motorctl_devices.load import load_device
from motorctl_devices.machine import Machine
from motorctl_devices.prompt_ptys import prompt_ptys
from motorctl_devices.schedule import NS, Fault

PRIORITY = 70
"""Below the loop's own, which may share the machine."""
MCL_CURRENT, MCL_FUTURE = 1, 2


def run_device(
    path: Path, link: Path | None, ready: Callable[[str], None], *, raise_workers: bool = False
) -> dict[str, Any]:
    """Serve the device of a file until SIGINT or SIGTERM; return its report.

    Parameters
    ----------
    path
        The device file.
    link
        Symbolic link to make to the serial port; None: none.
    ready
        Called with the endpoint once the device answers.
    raise_workers
        Meanwhile the kernel's threads that carry pseudo-terminals get a real-time priority.

    Returns
    -------
    dict
        The report, as plain data.

    Raises
    ------
    ConfigError, UsageError, RunError
    """
    device = load_device(path, link)
    with prompt_ptys() if raise_workers else nullcontext():
        return _serve(device, ready)


def _serve(device: Device, ready: Callable[[str], None]) -> dict[str, Any]:
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
    """Ask for locked memory and a real-time priority, as firmware has them; go on without."""
    # Memory first: with the priority it would keep a CPU from everybody while pages are fetched.
    ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


def report(device: Device) -> dict[str, Any]:
    """Return what a device did, as plain data.

    Parameters
    ----------
    device
        The device, after it ran.

    Returns
    -------
    dict
        Counts of exchanges, samples and commands, what became of every ordered fault, when its
        amplifiers were off, how fast its watchdog was, the longest pause [s], and how far each axis
        went to either side [counts].
    """
    machine, endpoint = device.machine, device.endpoint
    after_ns = machine.watchdog_after_ns
    return {
        "endpoint": endpoint.address,
        "exchanges": endpoint.exchanges,
        "samples": machine.samples,
        "commands": machine.commands,
        "refused": endpoint.refused,
        "watchdog_trips": machine.watchdog_trips,
        "restarts": machine.restarts,
        "faults": [
            {
                "kind": f.order.kind,
                "at_s": f.order.at_s,
                "fired": f.fired,
                "off_after_s": _off_after_s(f, machine),
                "watchdog_trips": f.watchdog_trips,
                "longest_pause_s": round(f.longest_pause_ns / NS, 6),
            }
            for f in device.schedule.faults
        ],
        "off_s": _rests_s(machine),
        "watchdog_after_s": None if after_ns is None else round(after_ns / NS, 6),
        "longest_pause_s": round(device.longest_pause_ns / NS, 6),
        "travelled_counts": machine.travelled_counts(),
    }


def _rests_s(machine: Machine) -> list[tuple[float, float | None]]:
    """Return from when to when every amplifier was off, for a while, by CLOCK_MONOTONIC [s]."""
    rests = [(round(off / NS, 6), round(on / NS, 6)) for off, on in machine.rests_ns]
    last: list[tuple[float, float | None]] = []
    if machine.off_ns is not None:
        last = [(round(machine.off_ns / NS, 6), None)]
    return [*rests, *last]


def _off_after_s(fault: Fault, machine: Machine) -> float | None:
    """Tell how long after a fault's begin the last amplifier went off, to stay off for a while."""
    if fault.began_ns is None:
        return None
    for off_ns, on_ns in machine.rests_ns:
        if on_ns > fault.began_ns:
            return max(0.0, round((off_ns - fault.began_ns) / NS, 6))
    if machine.off_ns is None:
        return None
    return max(0.0, round((machine.off_ns - fault.began_ns) / NS, 6))
