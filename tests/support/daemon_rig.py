"""A real daemon for the tests, on a bench slow enough for any machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import real_time

from motorctl.daemon.client import Client, DaemonRefusedError

START_TIMEOUT_S = 240.0  # the first run compiles
END_TIMEOUT_S = 60.0
PR_SET_PDEATHSIG = 1
"""From <linux/prctl.h>."""

AXIS = """
  {name}:
    driver: gantry
    channel: {channel}
    controller: C2
    encoder: {{resolution_m: 0.5e-6, counter_bits: 32}}
    limits:
      travel_m: [-0.05, 0.45]
      max_velocity_m_s: 1.0
      max_acceleration_m_s2: 10
      max_jerk_m_s3: 1000
      max_voltage_v: 10
      following_error: {{minimum_m: 0.05, per_velocity_s: 0.1, filter_time_s: 0.1}}
      stop: {{acceleration_m_s2: 2, jerk_m_s3: 40}}
    gains: {{k1_1_s: 25, ks_v_s_m: {ks}, gamma_d: 20, d_hat_max_v: 1}}
    model:
      inertia: {{initial: {inertia}, bounds: [0.05, 1.2]}}
      viscous_friction: {{initial: 0.25, bounds: [0.05, 0.6]}}
      coulomb_friction: {{initial: 0.15, bounds: [0.01, 0.4]}}
      offset: {{initial: 0, bounds: [-0.5, 0.5]}}
      em_quadratic: {{initial: -0.005, bounds: [-0.015, 0]}}
      em_cubic: {{initial: -0.0005, bounds: [-0.001, 0]}}
    adaptation: {{enabled: true, filter_rad_s: 60, keep_learned: {keep_learned}}}
    homing: {{method: absolute}}
    {program}
"""

DRIVER = "{type: sim, preset: published_gantry, seed: 1, late: {hold_ticks: 8}}"
"""It bears a computer that stands still for 20 ms: what such a pause does is no test's subject."""

PATIENT_S = 10
"""Silence of the supervisor that no test but those of its death makes a subject of: loops of other
tests, which go before it, have kept it waiting for two seconds."""

CONFIG = """
name: bench
rate_hz: 400
drivers:
  gantry: {driver}
axes:{x}{y}
programs:
  shuttle: {{kind: back_and_forth, axis: x, start_m: 0.05, distance_m: 0.05, max_velocity_m_s: 0.1,
    max_acceleration_m_s2: 1, jerk_time_s: 0.05, period_s: 2, cycles: 500}}
  ring: {{kind: circle, axes: [x, y], center_m: [0.1, 0.1], radius_m: 0.02, speed_m_s: 0.1,
    max_acceleration_m_s2: 1, max_jerk_m_s3: 50, turns: 1}}
loop: {{without_realtime: {without_realtime}, overrun_policy: count,
  supervisor_timeout_s: {supervisor_timeout_s}}}
"""


def bench_config(
    x_program: str = "",
    y_program: str = "",
    *,
    keep_learned: bool = False,
    without_realtime: str = "degrade",
    supervisor_timeout_s: float = PATIENT_S,
) -> str:
    """Write the configuration of two axes that stand a lot."""
    learned = str(keep_learned).lower()
    x, y = (
        AXIS.format(
            name=name,
            channel=channel,
            ks=ks,
            inertia=inertia,
            program=f"program: {program}" if program else "",
            keep_learned=learned,
        )
        for name, channel, ks, inertia, program in (
            ("x", 0, 10, 0.19, x_program),
            ("y", 1, 30, 0.6, y_program),
        )
    )
    return CONFIG.format(
        driver=DRIVER,
        x=x,
        y=y,
        without_realtime=without_realtime,
        supervisor_timeout_s=supervisor_timeout_s,
    )


class Daemon:
    """One run of ``motorctl run``; leaves nothing behind."""

    def __init__(self, folder: Path, config: str | None = None, **environment: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.config = folder / "bench.yaml"
        self.config.write_text(config or bench_config())
        self.socket = folder / "motorctl.sock"
        self.logs = folder / "logs"
        self.errors = folder / "stderr.txt"
        self._environment = {**os.environ, "XDG_STATE_HOME": str(folder / "state"), **environment}
        self.process = self.launch()

    def launch(self) -> subprocess.Popen[bytes]:
        """Start the daemon's process on this configuration, without waiting for it."""
        real_time.begins()
        with self.errors.open("ab") as errors:
            return subprocess.Popen(
                command("run", str(self.config), "--log-dir", str(self.logs), *self.at),
                stdout=subprocess.DEVNULL,
                stderr=errors,
                env=self._environment,
                start_new_session=True,
            )

    @property
    def at(self) -> tuple[str, str]:
        """The option that names the daemon's socket."""
        return "--socket", str(self.socket)

    def __enter__(self) -> Daemon:
        self.wait_until_running()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def wait_until_running(self) -> None:
        """Wait until the loop ticks and the recorder records."""
        deadline = time.monotonic() + START_TIMEOUT_S
        while self.process.poll() is None and time.monotonic() < deadline:
            if self.socket.exists():
                try:
                    with Client(self.socket) as client:
                        if client.ask("status")["recording"]["rows"] > 0:
                            return
                except Exception:  # not yet
                    pass
            time.sleep(0.1)
        raise AssertionError(f"the daemon did not start: {self.said}")

    @property
    def said(self) -> str:
        """Everything on its standard error so far."""
        return self.errors.read_text()

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Send one request on a connection of its own."""
        with Client(self.socket) as client:
            return client.ask(do, **arguments)

    def switch_off(self, *axes: str) -> None:
        """Leave axes without drive, whatever a test before left behind."""
        for axis in axes:
            if self.state(axis) == "fault":
                self.ask_when_it_stands("reset", axis)
            if self.state(axis) != "off":
                self.ask("stop", axis=axis)
                wait_until(lambda axis=axis: self.state(axis) == "off")

    def hold(self, *axes: str) -> None:
        """Enable axes that hold, whatever a test before left behind."""
        for axis in axes:
            if self.state(axis) not in {"off", "idle"}:
                self.switch_off(axis)
            self.ask_when_it_stands("start", axis)
            wait_until(lambda axis=axis: self.state(axis) == "idle")

    def ask_when_it_stands(self, do: str, axis: str, **arguments: Any) -> dict[str, Any]:
        """Command an axis without drive that may still coast."""
        answers: list[dict[str, Any]] = []

        def taken() -> bool:
            try:
                answers.append(self.ask(do, axis=axis, **arguments))
            except DaemonRefusedError as no:
                if no.code not in ("still_moving", "not_ready"):
                    raise
            return bool(answers)

        wait_until(taken)
        return answers[0]

    def state(self, axis: str) -> str:
        """Return the state of an axis."""
        state: str = self.ask("status", axis=axis)["axes"][axis]["state"]
        return state

    def cli(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of the client against this daemon."""
        return subprocess.run(
            command(*arguments, *self.at), capture_output=True, text=True, timeout=120, check=False
        )

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal to the supervisor and give its exit status."""
        self.process.send_signal(number)
        return self.process.wait(END_TIMEOUT_S)

    def log(self) -> Path:
        """Return the one log of this run."""
        (path,) = self.logs.glob("*.parquet")
        return path

    def partial_logs(self) -> list[Path]:
        """Return the unfinished logs of this run."""
        return sorted(self.logs.glob("*.partial"))


def command(*arguments: str) -> list[str]:
    """Return the command line of motorctl in this interpreter.

    Tests that a shell runs in its background inherit that Ctrl-C is ignored: not so the daemon.
    """
    return [
        sys.executable,
        "-c",
        ended_with_the_tests(
            "import signal as s; s.signal(s.SIGINT, s.default_int_handler);"
            "import motorctl.cli as c; c.GROUPS=('daemon',); c.main()"
        ),
        *arguments,
    ]


def ended_with_the_tests(code: str) -> str:
    """Return Python code that is told to end, as by SIGTERM, where this process is gone.

    A run of tests that is killed would leave its daemons behind, which disturb the next one.
    """
    tests = Path(f"/proc/{os.getpid()}")
    return (
        f"import ctypes, os, signal; ctypes.CDLL(None).prctl({PR_SET_PDEATHSIG}, signal.SIGTERM);"
        # it was gone before; a tree of another system may have no /proc to tell
        f"os.path.exists('/proc/self') and not os.path.exists('{tests}') and os._exit(1);"
        f"{code}"
    )


def wait_until(reached: Callable[[], bool], timeout_s: float = 60.0) -> None:
    """Poll until something is so."""
    deadline = time.monotonic() + timeout_s
    while not reached():
        assert time.monotonic() < deadline, "did not come about in time"
        time.sleep(0.02)


def alive(pid: int) -> bool:
    """Tell whether a process is there and not a zombie."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except FileNotFoundError:
        return False
    return stat.rsplit(")", 1)[1].split()[0] != "Z"


def raw_status(daemon: Daemon) -> dict[str, Any]:
    """Return the status as the client prints it with --json."""
    document: dict[str, Any] = json.loads(daemon.cli("status", "--json").stdout)
    return document
