"""Shipped simulated machines on a computer that pauses, as ordinary ones do now and then."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest
from daemon_rig import Daemon, wait_until

from motorctl.config import load
from motorctl.config.shipped import shipped_config, shipped_configs
from motorctl.daemon.client import DaemonRefusedError

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

PAUSE_S, EVERY_S = 8e-3, 1.0
MINUTES_S = 180.0
SIMULATED = [
    name
    for name in shipped_configs()
    if all(setup.cls.simulated for setup in load(name).drivers.values())
]


def _ready(daemon: Daemon, axis: str) -> None:
    """Home an axis that needs it."""
    told = daemon.ask("status")["axes"][axis]
    if not told["homed"]:
        daemon.ask_when_it_stands("home", axis)
        wait_until(lambda: daemon.state(axis) != "homing", 60.0)


def _pause(pid: int) -> None:
    os.kill(pid, signal.SIGSTOP)
    time.sleep(PAUSE_S)
    os.kill(pid, signal.SIGCONT)


@pytest.mark.parametrize(
    ("name", "lasts_s"),
    [
        ("published_gantry", 4.0),
        *(pytest.param(n, MINUTES_S, marks=[pytest.mark.long, pytest.mark.timeout(900)])
          for n in SIMULATED),
    ],
)  # fmt: skip
def test_a_shipped_machine_rides_out_a_pause_of_8_ms_in_every_second(
    tmp_path: Path, name: str, lasts_s: float
) -> None:
    with Daemon(tmp_path, shipped_config(name).read_text()) as daemon:
        axes = list(daemon.ask("status")["axes"])
        loop = daemon.ask("status")["loop"]
        for axis in axes:
            _ready(daemon, axis)
        pauses, end = 0, time.monotonic() + lasts_s
        while time.monotonic() < end:
            status = daemon.ask("status")
            for axis, told in status["axes"].items():
                assert told["fault"] is None, (pauses, told["fault"])
                if told["state"] in ("off", "idle"):  # its program is over: once more
                    with suppress(DaemonRefusedError):
                        daemon.ask_when_it_stands("start", axis)
            time.sleep(EVERY_S)
            _pause(loop["pid"])
            pauses += 1
        status = daemon.ask("status")
        for axis in axes:
            assert status["axes"][axis]["state"] in ("running", "idle")
            assert status["axes"][axis]["fault"] is None
        # They were pauses of the loop, each of dozens of periods.
        skipped = status["loop"]["skipped_periods"] - loop["skipped_periods"]
        assert skipped >= pauses * (PAUSE_S * load(name).rate_hz - 2)
        assert daemon.end() == 0, daemon.said
