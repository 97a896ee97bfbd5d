"""The daemon with C2 on vcan1 against `motorctl gantry-device`; judges nothing."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import yaml
from can_tools import candump, shell
from daemon_rig import Daemon
from loop_config import DEVICE, INTERFACE, can_driver, config, device_file

RESULT = Path(sys.argv[1])
DURATION_S = 8.0
LATEST_S = 150.0
QUIET = RESULT / "driver.done"
"""Appears when nobody else uses the processors."""


def main() -> None:
    told: dict[str, Any] = {}
    path = RESULT / "device.yaml"
    path.write_text(yaml.safe_dump(device_file()))
    device = subprocess.Popen(
        [*DEVICE, str(path), "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        # Effects in the order that was compiled outside. Beside each other: the daemon takes longer
        # until it opens the bus.
        starting = Daemon(RESULT / "daemon", yaml.safe_dump(config(can_driver()), sort_keys=False))
        assert device.stderr is not None
        told["ready"] = device.stderr.readline().strip()
        with starting as daemon:
            _live(daemon, told)
            told["exit_status"] = daemon.end()
    except Exception:
        told["failed"] = traceback.format_exc()
    device.send_signal(signal.SIGTERM)
    said, _ = device.communicate(timeout=30)
    told["device"] = json.loads(said) if said else None
    (RESULT / "loop.json").write_text(json.dumps(told))


def _live(daemon: Daemon, told: dict[str, Any]) -> None:
    _wait("the driver's story", QUIET.exists)
    with candump(RESULT / "loop.log", INTERFACE):
        for axis in "xy":
            daemon.ask_when_it_stands("start", axis)
        time.sleep(DURATION_S)
        told["running"] = daemon.ask("status")
    shell(f"ip link set {INTERFACE} down")
    _wait("the trip", lambda: all(daemon.state(axis) == "fault" for axis in "xy"))
    told["down"] = daemon.ask("status")
    shell(f"ip link set {INTERFACE} up")
    time.sleep(1.0)
    for axis in "xy":
        daemon.ask_when_it_stands("reset", axis)
        daemon.ask_when_it_stands("start", axis)
    time.sleep(1.0)
    told["up"] = daemon.ask("status")


def _wait(what: str, reached: Any) -> None:
    deadline = time.monotonic() + LATEST_S
    while not reached():
        if time.monotonic() > deadline:
            raise TimeoutError(what)
        time.sleep(0.1)


if __name__ == "__main__":
    main()
