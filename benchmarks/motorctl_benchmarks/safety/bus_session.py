"""One daemon and one device on a bus, through fault after fault: tripped, reset, started anew."""

from __future__ import annotations

import json
import os
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.errors import MotorctlError, RunError
from motorctl.latency.progress import Progress
from motorctl.log import Recording, read_recording
from motorctl_benchmarks.safety.bus_cases import BusKey
from motorctl_benchmarks.safety.bus_expectations import promise
from motorctl_benchmarks.safety.bus_faults import ORDERS, PAUSE_S, Options
from motorctl_benchmarks.safety.bus_lines import EVERY_LINE, device_file, free_port, host_file
from motorctl_benchmarks.safety.bus_process import (
    device_of,
    sleep_until,
    wait_until_running,
)

FIRST_S = 0.8
"""From the start of the axes to the first fault."""
LASTS_S = 0.9
PAUSED_S = 1.4
"""From a pause to the reset: the ramp is over, and the device has been off for as long as its
report takes for a rest."""
BETWEEN_S = 1.5
"""From a fault's end to the next: reset, started, and under way again."""
AS_TOLD_S = 1.0
"""More of that where the next fault comes in another state: the axes are stopped before."""
ASKED_S = 0.3
"""Before the fault's end a reset is asked for, where it has to be refused."""
LAST_LINES = 3
"""Of what a daemon said, where a session cannot be run through."""
SOON_S = 1.5
"""A reset is obeyed within that, once the device is back."""
START_SOON_S = 0.4
"""A start of an axis that was off is obeyed within that, or not before a reset."""
MOVED_S, STOPPED_S = 0.6, 0.08
"""Before a fault that is to meet motion or a ramp: when the axes set out, and are told to stop."""
HOMED_S = 0.4
"""Before a fault that is to meet homing."""
WAY_M, MIDDLE_M, SPEED_M_S, ACCELERATION_M_S2 = 0.12, 0.2, 0.1, 1.0
"""Of that motion: how far, on which side of which place, how fast, and how soon it is so fast."""
ORIGIN_ASKS = 40
"""How often the daemon is asked for the loop's time, to know it by the clock of the device."""


@dataclass(frozen=True)
class Session:
    """What is to be run: the cases of one bus and controller, in their order."""

    keys: tuple[BusKey, ...]

    @property
    def first(self) -> BusKey:
        """The first case, which has bus, controller and setup of all."""
        return self.keys[0]


@dataclass
class Spell:
    """What was seen of one fault while the session went on."""

    key: BusKey
    at_s: float
    refused: str = ""
    """The code with which a reset (off: a start) was refused while the fault lasted."""
    reset: str = ""
    """What kept the reset after it; empty: nothing."""
    told_reset: bool = False
    """An axis that was off had to be reset before it could be started."""
    wanted: str = "running"
    """The state to which the axes were started."""
    started: dict[str, str] = field(default_factory=dict)
    """The state of each axis a moment after its start."""
    status_time_s: float = 0.0
    """On the loop's clock, right before the reset."""
    told: dict[str, Any] = field(default_factory=dict)
    """The device's report; empty where it was ordered nothing."""


@dataclass(frozen=True)
class Kept:
    """What a session left behind."""

    spells: tuple[Spell, ...]
    log: Recording
    rows_lost: int
    origin_s: float
    """When the loop's clock was 0 at the earliest, by CLOCK_MONOTONIC."""
    unsure_s: float
    """How much later that may have been."""
    off_s: tuple[tuple[float, float | None], ...]
    """When all of the device's amplifiers were off, by CLOCK_MONOTONIC."""


def run_session(session: Session, progress: Progress) -> Kept:
    """Run a session. Raises RunError or another MotorctlError where it cannot be run through."""
    key, port = session.first, free_port()
    line = EVERY_LINE[key.line]
    times, orders = _times_of(session.keys)
    with tempfile.TemporaryDirectory(prefix="motorctl-campaign-") as name:
        file = device_file(line, port, [order for order in orders if order])
        with device_of(Path(name), line, file) as ends:
            host = host_file(line, key.controller, ends.endpoint, port, key.setup)
            with ends.daemon(host) as daemon:
                through = _Through(session.keys, times, orders)
                try:
                    wait_until_running(daemon, ends.socket)
                    with Client(ends.socket) as client:
                        through.run(client, progress)
                        origin_s, unsure_s = clock_origin_s(client, line.rate_hz)
                except MotorctlError as error:
                    last = " / ".join(daemon.said.splitlines()[-LAST_LINES:])
                    raise RunError(f"{error}; the daemon's last words: {last}") from error
                daemon.end()
            report = json.loads(ends.device.end())
            told = iter(report["faults"])
            for spell, order in zip(through.spells, orders, strict=True):
                spell.told = next(told) if order else {}
            log = read_recording(ends.log, gaps="keep")
        lost = int(log.metadata.get("rows_lost", 0))
        rests = tuple((off, on) for off, on in report["off_s"])
        return Kept(tuple(through.spells), log, lost, origin_s, unsure_s, rests)


def _times_of(keys: Sequence[BusKey]) -> tuple[list[float], list[Options | None]]:
    """Return when each fault begins, and what the device is ordered; None: nothing."""
    times: list[float] = []
    orders: list[Options | None] = []
    at_s = FIRST_S
    for k, key in enumerate(keys):
        if k and key.state != "shuttle":
            at_s += AS_TOLD_S
        times.append(round(at_s, 3))
        wire = ORDERS.get(key.fault)
        orders.append({"duration_s": LASTS_S, **wire[1], "at_s": times[-1]} if wire else None)
        at_s += _lasts_s(orders[-1]) + BETWEEN_S
    return times, orders


def _lasts_s(order: Options | None) -> float:
    return max(LASTS_S, float(order["duration_s"])) if order else PAUSED_S


class _Through:
    """Leads both axes through the faults of a session."""

    def __init__(
        self, keys: Sequence[BusKey], times: Sequence[float], orders: Sequence[Options | None]
    ) -> None:
        self._keys, self._times, self._orders = keys, times, orders
        self.spells: list[Spell] = []

    def run(self, client: Client, progress: Progress) -> None:
        keys = self._keys
        # The device's clock begins with the first power: by then no axis may be anywhere else.
        began = time.monotonic()
        axes = EVERY_LINE[keys[0].line].axes
        _each(client, axes, "start", hold=keys[0].state != "shuttle")
        if keys[0].state == "off":
            _each(client, axes, "stop")
        for k, key in enumerate(keys):
            wanted = promise(key.line, key.state, key.fault)
            assert wanted is not None
            spell = Spell(key, self._times[k])
            self.spells.append(spell)
            at = began + spell.at_s
            _bring_to(client, axes, key.state, at)
            if self._orders[k] is None:
                sleep_until(at)
                _pause(client)
            over = at + _lasts_s(self._orders[k])
            sleep_until(over - ASKED_S)
            if wanted.asked:
                spell.refused = _asked(client, key.state)
            sleep_until(over + 0.05)
            spell.status_time_s = float(client.ask("status")["loop"]["time_s"])
            last = k + 1 == len(keys)
            follows = "hold" if key.setup == "homes" else key.state if last else keys[k + 1].state
            hold = follows != "shuttle"
            spell.wanted = "idle" if hold else "running"
            _again(client, axes, spell, hold)
            if follows == "off":
                _each(client, axes, "stop")
            progress((k + 1) / len(keys))
        time.sleep(0.2)


def _bring_to(client: Client, axes: Sequence[str], state: str, at: float) -> None:
    """Let both axes be in the state when the fault comes; they move, hold or are off already."""
    if state == "homing":
        sleep_until(at - HOMED_S)
        for axis in axes:
            client.ask("home", axis=axis)
    elif state in ("stop", "cruise"):
        sleep_until(at - MOVED_S)
        for axis in axes:
            here = float(client.axis(axis)["position_m"])
            there = here + (WAY_M if here < MIDDLE_M else -WAY_M)
            client.ask("move", axis=axis, position_m=there, velocity_m_s=SPEED_M_S,
                       acceleration_m_s2=ACCELERATION_M_S2)  # fmt: skip
        if state == "stop":
            sleep_until(at - STOPPED_S)
            for axis in axes:
                client.ask("stop", axis=axis)


def _pause(client: Client) -> None:
    """Stop the loop's process for a while, as a busy or sleeping computer does."""
    pid = int(client.ask("status")["loop"]["pid"])
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(PAUSE_S)
    finally:
        os.kill(pid, signal.SIGCONT)


def _asked(client: Client, state: str) -> str:
    """Ask for what has to be refused; return the code, empty where it was obeyed."""
    if state == "off":
        return _refused(lambda: client.ask("start", axis="x", hold=True))
    return _refused(lambda: client.ask("reset", axis="x"))


def _again(client: Client, axes: Sequence[str], spell: Spell, hold: bool) -> None:
    """Reset and start both axes, as soon as the device is back.

    An axis that is off is started; where that is refused, it is reset and started.
    """
    try:
        for axis in axes:
            if spell.key.state == "off":
                if not _soon(partial(client.ask, "start", axis=axis, hold=True), START_SOON_S):
                    continue
                spell.told_reset = True
            elif client.axis(axis)["state"] != "fault":
                continue
            spell.reset = spell.reset or _soon(partial(client.ask, "reset", axis=axis), SOON_S)
        _each(client, axes, "start", hold=hold)
    except MotorctlError as error:
        spell.reset = spell.reset or str(error)
    states = client.ask("status")["axes"]
    spell.started = {axis: states[axis]["state"] for axis in axes}


def _soon(do: Callable[[], object], soon_s: float) -> str:
    """Do it as soon as it is obeyed; return the code of the refusal where it never is."""
    deadline = time.monotonic() + soon_s
    while (code := _refused(do)) and time.monotonic() < deadline:
        time.sleep(0.02)
    return code


def _each(client: Client, axes: Sequence[str], do: str, **arguments: Any) -> None:
    for axis in axes:
        client.ask_when_ready(do, lambda _: None, axis=axis, **arguments)


def _refused(do: Callable[[], object]) -> str:
    """Return the code with which a command was refused; empty: it was obeyed."""
    try:
        do()
    except DaemonRefusedError as refusal:
        return refusal.code
    return ""


def clock_origin_s(client: Client, rate_hz: float) -> tuple[float, float]:
    """Return when the loop's clock was 0 by CLOCK_MONOTONIC at the earliest, and how much later it
    may have been.

    The newest tick that an answer tells of is no later than the answer, and less than a period
    older than the question.
    """
    latest, earliest = float("inf"), float("-inf")
    for _ in range(ORIGIN_ASKS):
        asked = time.monotonic()
        told = float(client.ask("status")["loop"]["time_s"])
        latest = min(latest, time.monotonic() - told)
        earliest = max(earliest, asked - told - 1.0 / rate_hz)
        time.sleep(0.61 / rate_hz)
    return min(earliest, latest), max(0.0, latest - earliest)
