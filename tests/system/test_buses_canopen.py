"""An axis on simulated CiA 402 drives: homed, moved, faulted by its drive, reset, moved again."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
import yaml
from buses_bench import AXES, DeviceProcess, Options, free_port
from daemon_rig import Daemon, bench_config, wait_until

from motorctl.daemon.client import DaemonRefusedError

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

RATE_HZ = 200.0
HOST_WATCHDOG_S, DEAF_AT_S, DEAF_S, HOLD_S = 0.15, 12.0, 0.25, 0.5
HOMING = {
    "method": "switch",
    "search_velocity_m_s": -0.05,
    "latch_velocity_m_s": 0.02,
    "home_position_m": -0.02,
    "timeout_s": 20.0,
}
MULTICAST = "239.74.163.8"


def device_file(port: int) -> Options:
    """Return two drives that hear nothing for a while, and so go into Fault by themselves."""
    channel = {"resolution_m": 0.5e-6, "counter_bits": 32, "max_voltage_v": 10.0}
    nodes = [{"node": number, "rated_torque_v": 8.0} for number in (1, 2)]
    bus = {"interface": "udp_multicast", "channel": MULTICAST, "port": port}
    deaf = {"kind": "silence", "at_s": DEAF_AT_S, "duration_s": DEAF_S, "way": "to_device"}
    return {
        "gantry": {"preset": "published_gantry", "seed": 1},
        "channels": [{"axis": axis, **channel} for axis in AXES],
        "rate_hz": 4 * RATE_HZ,
        "watchdog_s": 2.0,
        "serve": {"canopen": {**bus, "nodes": nodes}},
        "faults": [deaf],
    }


def host_file(port: int) -> str:
    """Return the axes on the drives, x to be homed by the switch at the drive's inputs."""
    inputs = {"limit_negative": 0, "limit_positive": 1, "home_switch": 2}
    data = yaml.safe_load(bench_config())
    data["rate_hz"] = RATE_HZ
    data["drivers"]["gantry"] = {
        "type": "canopen",
        "interface": "udp_multicast",
        "channel": MULTICAST,
        "port": port,
        "sync": {"wait_s": 3e-3},
        "watchdog_s": HOST_WATCHDOG_S,
        "nodes": {
            axis: {"node": number, "rated_torque_v": 8.0, "inputs": inputs}
            for number, axis in enumerate(AXES, 1)
        },
        "late": {"hold_ticks": round(HOLD_S * RATE_HZ), "predict": True},
    }
    data["axes"]["x"]["homing"] = HOMING
    return yaml.safe_dump(data)


def test_an_axis_on_canopen_is_enabled_homed_moved_faulted_reset_and_moved_again(tmp_path: Path):
    port = free_port()
    with DeviceProcess(tmp_path, device_file(port)) as device:
        with Daemon(tmp_path / "daemon", host_file(port)) as daemon:
            x = lambda: daemon.ask("status", axis="x")["axes"]["x"]  # noqa: E731
            assert x()["drive_state"] == "ready_to_switch_on"
            began = time.monotonic()
            daemon.ask("home", axis="x")
            wait_until(lambda: x()["homed"] and x()["state"] == "idle", 20.0)
            daemon.ask("move", axis="x", position_m=0.05)
            wait_until(lambda: x()["state"] == "idle", 10.0)
            assert abs(x()["position_m"] - 0.05) < 1e-3
            assert time.monotonic() - began < DEAF_AT_S
            # The drives hear nothing for longer than their watchdog allows.
            wait_until(lambda: x()["state"] == "fault", 20.0)
            told = x()["fault"]
            assert told["cause"] == "amplifier"
            assert "error 8130h: life guard or heartbeat" in told["message"]
            with pytest.raises(DaemonRefusedError):
                daemon.ask("start", axis="x")
            wait_until(lambda: abs(x()["velocity_m_s"]) < 1e-3, 10.0)
            answer = daemon.ask("reset", axis="x")
            assert answer["cleared"]
            assert answer["homed"]
            wait_until(lambda: x()["drive_state"] == "ready_to_switch_on", 5.0)
            daemon.ask("start", axis="x", hold=True)
            daemon.ask("move", axis="x", position_m=0.02)
            wait_until(lambda: x()["state"] == "idle", 10.0)
            assert abs(x()["position_m"] - 0.02) < 1e-3
            # y was off all the while: its drive had the same fault, and is cleared as well.
            assert daemon.ask("reset", axis="y")["cleared"]
            wait_until(lambda: not daemon.ask("status", axis="y")["axes"]["y"]["device"], 5.0)
            assert daemon.end() == 0
        device.end()
    assert device.report["refused"] == 0
