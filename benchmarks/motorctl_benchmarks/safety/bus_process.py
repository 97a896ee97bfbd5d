"""The processes at both ends of a bus: begun, listened to, and ended by their own ids."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

from motorctl.daemon.client import Client
from motorctl.errors import MotorctlError, RunError
from motorctl_benchmarks.safety.bus_lines import WITHOUT_PORT, Line
from motorctl_devices.prompt_ptys import can_be_prompt

MAIN = (sys.executable, "-P", "-c", "from motorctl.cli import main; main()")
START_S = 240.0
"""The first start compiles."""
END_S = 30.0


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
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def said(self) -> str:
        """What it said on standard error."""
        return self.errors.read_text(errors="replace")

    def line(self) -> str:
        """Return the next line of its output; empty where none comes."""
        assert self._process.stdout is not None
        heard, _, _ = select.select([self._process.stdout], [], [], START_S)
        return self._process.stdout.readline() if heard else ""

    def wait(self) -> None:
        """Wait until it has ended by itself. Raises RunError."""
        self._communicate()

    def end(self) -> str:
        """End it as a user does; return the rest of its output. Raises RunError."""
        self._process.send_signal(signal.SIGTERM)
        return self._communicate()

    def _communicate(self) -> str:
        try:
            out, _ = self._process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired as error:
            raise RunError(f"a process did not end within {END_S:g} s") from error
        return out


class Ends:
    """The device's process, and what a daemon's needs to meet it."""

    def __init__(self, folder: Path, line: Line, device: Process, endpoint: str) -> None:
        self._folder = folder
        self.device = device
        self.endpoint = str(folder / "link") if line.name not in WITHOUT_PORT else endpoint
        """Where the driver finds the device."""
        self.socket = folder / "motorctl.sock"

    @property
    def log(self) -> Path:
        """Return the one log of the run."""
        (log,) = (self._folder / "logs").glob("*.parquet")
        return log

    def daemon(self, host: str) -> Process:
        """Begin a daemon with a configuration."""
        config = self._folder / "gantry.yaml"
        config.write_text(host)
        run = ("--log-dir", str(self._folder / "logs"), "--socket", str(self.socket))
        return Process(
            "run", str(config), *run,
            errors=self._folder / "run.txt", environment=_environment(self._folder),
        )  # fmt: skip


@contextmanager
def device_of(folder: Path, line: Line, file: str) -> Iterator[Ends]:
    """Serve a device of a file, its end of the line in order. Raises RunError."""
    path = folder / "device.yaml"
    path.write_text(file)
    prompt = ["--raise-workers"] if can_be_prompt() else []
    link = ["--link", str(folder / "link")] if line.name not in WITHOUT_PORT else []
    arguments = ("gantry-device", str(path), "--json", *link, *prompt)
    environment = _environment(folder)
    with Process(*arguments, errors=folder / "device.txt", environment=environment) as device:
        yield Ends(folder, line, device, _ready(device))


def _environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "XDG_STATE_HOME": str(folder / "state")}


def _ready(device: Process) -> str:
    """Wait until the device serves; with --json it says so on standard error."""
    deadline = time.monotonic() + START_S
    while device.alive and time.monotonic() < deadline:
        for line in device.said.splitlines():
            if line.startswith("ready: "):
                return line.removeprefix("ready: ").strip()
        time.sleep(0.05)
    raise RunError(f"the device did not start: {device.said.strip() or 'silent'}")


def wait_until_running(daemon: Process, socket: Path) -> None:
    """Wait until the loop ticks and is recorded. Raises RunError."""
    deadline = time.monotonic() + START_S
    while daemon.alive and time.monotonic() < deadline:
        if socket.exists():
            with suppress(MotorctlError), Client(socket) as client:
                if client.ask("status")["recording"]["rows"] > 0:
                    return
        time.sleep(0.1)
    raise RunError(f"the daemon did not start: {daemon.said.strip() or 'silent'}")


def sleep_until(moment: float) -> None:
    """Sleep until a time by CLOCK_MONOTONIC [s]."""
    time.sleep(max(0.0, moment - time.monotonic()))
