"""One daemon and one device through fault after fault: tripped, reset and started in between."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from buses_bench import (
    AXES,
    END_S,
    Bus,
    DeviceProcess,
    Options,
    Outcome,
    device_file,
    free_port,
    host_file,
    start,
)
from daemon_rig import Daemon, wait_until

from motorctl.daemon.client import DaemonRefusedError
from motorctl.log import read_recording
from motorctl.log.info import describe
from motorctl.log.sample import AxisState, FaultCause

FIRST_S = 0.8
"""From the start of the axes to the first fault."""
LASTS_S = 0.9
"""A fault that stays is there until both axes have tripped and stood for SETTLE_S."""
BETWEEN_S = 1.4
"""From a fault's end to the next: reset, started, and under way again."""
SETTLE_S = 0.4
REST_S = 0.6
"""From a fault's begin to the reset: the watchdog has fired, and the amplifiers have been off
for so long that the device's report takes it for a rest."""
SOON_S = 1.0
"""A command is taken within that, once the device is back."""


@dataclass(frozen=True)
class Spell:
    """One fault of the sequence, and what it left behind."""

    name: str
    outcome: Outcome
    """Of the whole sequence."""
    at_s: float
    """When it was ordered to begin, on the faults' clock."""
    told: dict[str, Any]
    """The device's report of it."""
    status: dict[str, Any]
    """As `status` told it before the axes were reset."""
    opened: bool
    """The first reset after it opened the driver anew."""
    rows: slice
    """Of the log: from shortly before it to the reset."""

    @property
    def pause_s(self) -> float:
        """The longest pause that this machine made meanwhile, in the loop or in the device."""
        log = self.outcome.log
        assert log.lateness_s is not None
        skipped_s = float(np.diff(log.time_s[self.rows]).max()) - log.period_s
        loop_s = float(log.lateness_s[self.rows].max()) + max(0.0, skipped_s)
        return max(loop_s, float(self.told["longest_pause_s"]))

    def trip_row(self, axis: str) -> int:
        """Return the row in which an axis tripped."""
        state = self.outcome.log.axes[axis].state
        assert state is not None
        return self.rows.start + int(np.flatnonzero(state[self.rows] == AxisState.FAULT)[0])

    def cause(self, axis: str) -> FaultCause:
        fault = self.outcome.log.axes[axis].fault
        assert fault is not None
        return FaultCause(int(fault[self.trip_row(axis)]))


def times_of(orders: Mapping[str, Options]) -> list[Options]:
    """Return the orders with their times, one after another."""
    timed, at_s = [], FIRST_S
    for order in orders.values():
        timed.append({"duration_s": LASTS_S, **order, "at_s": round(at_s, 3)})
        at_s += max(LASTS_S, timed[-1]["duration_s"]) + BETWEEN_S
    return timed


def run_through(
    folder: Path, bus: Bus, orders: Mapping[str, Options]
) -> tuple[Outcome, list[Spell]]:
    """Move both axes over a bus; after each fault, by its name, reset and start them again."""
    port, timed = free_port(), times_of(orders)
    link = None if bus.name in ("modbus tcp", "can udp_multicast", "canopen") else folder / "link"
    told: list[tuple[dict[str, Any], bool]] = []
    with DeviceProcess(folder, device_file(bus, port, timed), link) as device:
        config = host_file(bus, bus.driver(str(link or device.endpoint), port))
        with Daemon(folder / "daemon", config) as daemon:
            began_s = time.monotonic()
            for axis in AXES:
                start(daemon, axis)
            for order in timed:
                wait_until(lambda: all(daemon.state(axis) == "fault" for axis in AXES), 10.0)
                time.sleep(SETTLE_S)
                status = daemon.ask("status")
                over_s = began_s + order["at_s"] + max(order["duration_s"], REST_S)
                time.sleep(max(0.0, over_s + 0.05 - time.monotonic()))
                answers = [_reset(daemon, axis) for axis in AXES]
                told.append((status, "opened" in answers[0]))
                if order is not timed[-1]:
                    for axis in AXES:
                        start(daemon, axis)
            status, began_s = daemon.ask("status"), time.monotonic()
            exit_status = daemon.end()
            ended_in_s = time.monotonic() - began_s
            said, log = daemon.said, read_recording(daemon.log(), gaps="keep")
            info = describe(daemon.log())
        device.end()
        assert device.ended_in_s < END_S
    outcome = Outcome(bus, status, said, exit_status, ended_in_s, device.report, log, info)
    return outcome, _spells(outcome, list(orders), timed, told)


def _reset(daemon: Daemon, axis: str) -> dict[str, Any]:
    """Reset an axis, as soon as its device is back."""
    deadline_s = time.monotonic() + SOON_S
    while time.monotonic() < deadline_s:
        with suppress(DaemonRefusedError):
            return daemon.ask("reset", axis=axis)
        time.sleep(0.02)
    return daemon.ask("reset", axis=axis)


def _spells(
    outcome: Outcome,
    names: Sequence[str],
    timed: Sequence[Options],
    told: Sequence[tuple[dict[str, Any], bool]],
) -> list[Spell]:
    log, spells = outcome.log, []
    for name, order, report, (status, opened) in zip(
        names, timed, outcome.report["faults"], told, strict=True
    ):
        first = outcome.window(order["at_s"] - 0.1, np.inf).start
        last = int(np.searchsorted(log.time_s, status["loop"]["time_s"]))
        spells.append(
            Spell(name, outcome, order["at_s"], report, status, opened, slice(first, last))
        )
    return spells
