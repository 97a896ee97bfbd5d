"""The loop is killed on a bus: how long until the device's amplifiers are off, and by whom."""

from __future__ import annotations

import json
import os
import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.daemon.client import Client
from motorctl_benchmarks.buses.transports import AXES
from motorctl_benchmarks.safety.bus_cases import BusKey
from motorctl_benchmarks.safety.bus_expectations import SUPERVISOR_S, command_s, fed_s
from motorctl_benchmarks.safety.bus_faults import BOTH_KILLED, WATCHDOG_S
from motorctl_benchmarks.safety.bus_lines import LINES, device_file, free_port, host_file
from motorctl_benchmarks.safety.bus_process import device_of, wait_until_running

LONG_WATCHDOG_S = 3.0
"""Of a device whose amplifiers the supervisor has to switch off: longer than that takes."""
UNDER_WAY_S = 0.6
"""From the start of the axes to the kill."""
AFTER_S = 0.3
"""From the amplifiers off to the device's end, or its report takes it for no rest."""


@dataclass(frozen=True)
class KillOutcome:
    """What became of a device whose loop was killed."""

    key: BusKey
    watchdog_s: float = WATCHDOG_S
    """The device's own, as it was configured."""
    kill_ms: float | None = None
    """From the kill to the amplifiers off."""
    own_ms: float | None = None
    """From the last command that the device heard to that, where its watchdog did it."""
    watchdog_trips: int = 0
    pause_ms: float = 0.0
    failures: tuple[str, ...] = ()
    rows_lost: int = 0

    @property
    def right(self) -> bool:
        """Whether everything was as promised."""
        return not self.failures

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "case": str(self.key),
            "watchdog_s": self.watchdog_s,
            "kill_ms": self.kill_ms,
            "own_ms": self.own_ms,
            "watchdog_trips": self.watchdog_trips,
            "pause_ms": self.pause_ms,
            "failures": list(self.failures),
        }


def run_kill(key: BusKey) -> KillOutcome:
    """Kill the loop, or loop and supervisor at once, while both axes move.

    Raises RunError or another MotorctlError where the session cannot be run through.
    """
    line, port = LINES[key.line], free_port()
    watchdog_s = WATCHDOG_S if key.fault == BOTH_KILLED else LONG_WATCHDOG_S
    with tempfile.TemporaryDirectory(prefix="motorctl-campaign-") as name:
        file = device_file(line, port, [], watchdog_s=watchdog_s)
        with device_of(Path(name), line, file) as ends:
            host = host_file(line, key.controller, ends.endpoint, port, watchdog_s=watchdog_s)
            with ends.daemon(host) as daemon:
                wait_until_running(daemon, ends.socket)
                with Client(ends.socket) as client:
                    for axis in AXES:
                        client.ask_when_ready("start", lambda _: None, axis=axis)
                    time.sleep(UNDER_WAY_S)
                    loop = int(client.ask("status")["loop"]["pid"])
                if key.fault == BOTH_KILLED:  # the supervisor first: it may do nothing any more
                    os.kill(daemon.pid, signal.SIGKILL)
                before_s = time.monotonic()
                os.kill(loop, signal.SIGKILL)
                killed_s = before_s, time.monotonic()
                daemon.wait()
                time.sleep(WATCHDOG_S + AFTER_S)
            report = json.loads(ends.device.end())
    return kill_judged(key, report, watchdog_s, killed_s)


def kill_judged(
    key: BusKey, report: dict[str, Any], watchdog_s: float, killed_s: tuple[float, float]
) -> KillOutcome:
    """Judge the device's report: its watchdog is on time, or the supervisor was before it.

    Parameters
    ----------
    key
        The case.
    report
        Of the device.
    watchdog_s
        The device's own, as it was configured.
    killed_s
        Right before the kill and right after it, by CLOCK_MONOTONIC: between them it was.
    """
    trips, pause_s = int(report["watchdog_trips"]), float(report["longest_pause_s"])
    period_s = 1.0 / LINES[key.line].rate_hz
    offs = [off for off, on in report["off_s"] if on is None]
    before_s, after_s = killed_s
    kill_s = offs[0] - before_s if offs else None
    own_s = report["watchdog_after_s"]
    failures = []
    if kill_s is None:
        failures.append("an amplifier was still on")
    if key.fault == BOTH_KILLED:
        late_s = command_s(key.line, period_s) + pause_s + after_s - before_s
        if trips != 1:
            failures.append(f"the device's watchdog tripped {trips} times, should be once")
        if own_s is not None and not 0.0 <= own_s - watchdog_s <= late_s:
            failures.append(_told("off", own_s, "the last command", watchdog_s, late_s))
        # What feeds the watchdog was sent before the kill: by a period, or a heartbeat's interval.
        early_s = late_s + fed_s(key.line, watchdog_s)
        if kill_s is not None and not -early_s <= kill_s - watchdog_s <= late_s:
            failures.append(_told("off", kill_s, "the kill", watchdog_s, late_s, early_s))
    else:
        if trips:
            failures.append(f"the device's watchdog tripped {trips} times, should not")
        if kill_s is not None and kill_s > SUPERVISOR_S + pause_s:
            failures.append(_told("off", kill_s, "the kill", 0.0, SUPERVISOR_S + pause_s))
    return KillOutcome(
        key,
        watchdog_s,
        None if kill_s is None else 1e3 * kill_s,
        None if own_s is None or key.fault != BOTH_KILLED else 1e3 * own_s,
        trips,
        1e3 * pause_s,
        tuple(failures),
    )


def _told(
    what: str, took_s: float, since: str, should_s: float, late_s: float, early_s: float = 0.0
) -> str:
    less = f" and {1e3 * early_s:.1f} less" if early_s else ""
    return (
        f"{what} {1e3 * took_s:.1f} ms after {since}, should be {1e3 * should_s:.0f}, "
        f"up to {1e3 * late_s:.1f} more{less}"
    )
