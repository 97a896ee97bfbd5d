"""One daemon and one device on a bus, through fault after fault: tripped, reset, started anew."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

from motorctl.daemon.client import Client, DaemonRefusedError
from motorctl.errors import MotorctlError, RunError
from motorctl.latency.progress import Progress
from motorctl.log import Recording, read_recording
from motorctl_benchmarks.safety.bus_lines import (
    LINES,
    WIRE,
    WITHOUT_PORT,
    Line,
    Options,
    device_file,
    free_port,
    host_file,
    promise,
)
from motorctl_devices.prompt_ptys import can_be_prompt

AXES = ("x", "y")
MAIN = (sys.executable, "-P", "-c", "from motorctl.cli import main; main()")
START_S = 240.0
"""The first start compiles."""
END_S = 30.0
FIRST_S = 0.8
"""From the start of the axes to the first fault."""
LASTS_S = 0.9
BETWEEN_S = 1.5
"""From a fault's end to the next: reset, started, and under way again."""
ASKED_S = 0.3
"""Before the fault's end a reset is asked for, where it has to be refused."""
LAST_LINES = 3
"""Of what a daemon said, where a session cannot be run through."""
SOON_S = 1.5
"""A command is taken within that, once the device is back."""


@dataclass(frozen=True)
class Session:
    """What is to be run: a bus, a controller, and faults of WIRE in their order."""

    line: str
    controller: str
    faults: tuple[str, ...]
    seed: int


@dataclass
class Spell:
    """What was seen of one fault while the session went on."""

    fault: str
    at_s: float
    refused: str = ""
    """The code with which a reset was refused while the fault lasted."""
    reset: str = ""
    """What kept the reset after it; empty: nothing."""
    started: dict[str, str] = field(default_factory=dict)
    """The state of each axis a moment after its start."""
    status_time_s: float = 0.0
    """On the loop's clock, right before the reset."""
    told: dict[str, Any] = field(default_factory=dict)
    """The device's report."""


@dataclass(frozen=True)
class Kept:
    """What a session left behind."""

    session: Session
    spells: tuple[Spell, ...]
    log: Recording
    rows_lost: int


class Process:
    """A command of motorctl, ended by its own process id."""

    def __init__(self, *arguments: str, errors: Path, environment: dict[str, str]) -> None:
        self.errors = errors
        with errors.open("wb") as file:
            self._process = subprocess.Popen(
                [*MAIN, *arguments], stdout=subprocess.PIPE, stderr=file, env=environment, text=True
            )

    def __enter__(self) -> Process:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    @property
    def said(self) -> str:
        """What it said on standard error."""
        return self.errors.read_text(errors="replace")

    def line(self) -> str:
        """Return the next line of its output; empty where none comes."""
        assert self._process.stdout is not None
        heard, _, _ = select.select([self._process.stdout], [], [], START_S)
        return self._process.stdout.readline() if heard else ""

    def end(self) -> str:
        """End it as a user does; return the rest of its output. Raises RunError."""
        self._process.send_signal(signal.SIGTERM)
        try:
            out, _ = self._process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired as error:
            raise RunError(f"a process did not end within {END_S:g} s") from error
        return out


def run_session(session: Session, progress: Progress) -> Kept:
    """Run a session. Raises RunError or another MotorctlError where it cannot be run through."""
    line, port = LINES[session.line], free_port()
    timed = _times_of(session.faults)
    with tempfile.TemporaryDirectory(prefix="motorctl-campaign-") as name:
        folder = Path(name)
        environment = {**os.environ, "XDG_STATE_HOME": str(folder / "state")}
        device_path, config = folder / "device.yaml", folder / "gantry.yaml"
        device_path.write_text(device_file(line, port, timed))
        prompt = ["--raise-workers"] if can_be_prompt() else []
        link = ["--link", str(folder / "link")] if _has_port(line) else []
        arguments = ("gantry-device", str(device_path), "--json", *link, *prompt)
        with Process(*arguments, errors=folder / "device.txt", environment=environment) as device:
            endpoint = _ready(device)
            at = str(folder / "link") if link else endpoint
            config.write_text(host_file(line, session.controller, at, port))
            logs, socket = folder / "logs", folder / "motorctl.sock"
            run = ("run", str(config), "--log-dir", str(logs), "--socket", str(socket))
            with Process(*run, errors=folder / "run.txt", environment=environment) as daemon:
                asked = [_asked(line, fault) for fault in session.faults]
                try:
                    spells = _through(daemon, socket, session.faults, timed, asked, progress)
                except MotorctlError as error:
                    last = " / ".join(daemon.said.splitlines()[-LAST_LINES:])
                    raise RunError(f"{error}; the daemon's last words: {last}") from error
                daemon.end()
            report = json.loads(device.end())
        for spell, told in zip(spells, report["faults"], strict=True):
            spell.told = told
        (log,) = logs.glob("*.parquet")
        recording = read_recording(log, gaps="keep")
        return Kept(session, spells, recording, int(recording.metadata.get("rows_lost", 0)))


def _has_port(line: Line) -> bool:
    return line.name not in WITHOUT_PORT


def _asked(line: Line, fault: str) -> bool:
    wanted = promise(line.name, fault)
    return wanted is not None and wanted.asked


def _ready(device: Process) -> str:
    """Wait until the device serves; with --json it says so on standard error."""
    deadline = time.monotonic() + START_S
    while device.alive and time.monotonic() < deadline:
        for line in device.said.splitlines():
            if line.startswith("ready: "):
                return line.removeprefix("ready: ").strip()
        time.sleep(0.05)
    raise RunError(f"the device did not start: {device.said.strip() or 'silent'}")


def _times_of(faults: Sequence[str]) -> list[Options]:
    timed, at_s = [], FIRST_S
    for fault in faults:
        timed.append({"duration_s": LASTS_S, **WIRE[fault][1], "at_s": round(at_s, 3)})
        at_s += max(LASTS_S, timed[-1]["duration_s"]) + BETWEEN_S
    return timed


def _through(
    daemon: Process,
    socket: Path,
    faults: Sequence[str],
    timed: Sequence[Options],
    asked: Sequence[bool],
    progress: Progress,
) -> tuple[Spell, ...]:
    spells = []
    _wait_until_running(daemon, socket)
    with Client(socket) as client:
        began = time.monotonic()
        for axis in AXES:
            _start(client, axis)
        for k, (fault, order) in enumerate(zip(faults, timed, strict=True)):
            spell = Spell(fault, order["at_s"])
            spells.append(spell)
            over = began + order["at_s"] + max(order["duration_s"], LASTS_S)
            _sleep_until(over - ASKED_S)
            if asked[k]:
                spell.refused = _refused(client, "reset", "x")
            _sleep_until(over + 0.05)
            spell.status_time_s = float(client.ask("status")["loop"]["time_s"])
            _again(client, spell)
            progress((k + 1) / len(faults))
        time.sleep(0.2)
    return tuple(spells)


def _again(client: Client, spell: Spell) -> None:
    """Reset and start both axes, as soon as the device is back."""
    deadline = time.monotonic() + SOON_S
    states = client.ask("status")["axes"]
    for axis in AXES:
        while states[axis]["state"] == "fault":
            spell.reset = _refused(client, "reset", axis)
            if not spell.reset or time.monotonic() > deadline:
                break
            time.sleep(0.02)
    try:
        for axis in AXES:
            _start(client, axis)
    except MotorctlError as error:
        spell.reset = spell.reset or str(error)
    states = client.ask("status")["axes"]
    spell.started = {axis: states[axis]["state"] for axis in AXES}


def _start(client: Client, axis: str) -> None:
    client.ask_when_ready("start", lambda: None, axis=axis)


def _refused(client: Client, do: str, axis: str) -> str:
    """Return the code with which a command was refused; empty: it was obeyed."""
    try:
        client.ask(do, axis=axis)
    except DaemonRefusedError as refusal:
        return refusal.code
    return ""


def _wait_until_running(daemon: Process, socket: Path) -> None:
    deadline = time.monotonic() + START_S
    while daemon.alive and time.monotonic() < deadline:
        if socket.exists():
            with suppress(MotorctlError), Client(socket) as client:
                if client.ask("status")["recording"]["rows"] > 0:
                    return
        time.sleep(0.1)
    raise RunError(f"the daemon did not start: {daemon.said.strip() or 'silent'}")


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.monotonic()))
