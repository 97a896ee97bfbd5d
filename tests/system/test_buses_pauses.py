"""A loop that stands still for longer than the device at the other end of its bus waits for it."""

from __future__ import annotations

import copy
import os
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from buses_bench import (
    AXES,
    BUSES,
    WATCHDOG_S,
    Bus,
    DeviceProcess,
    device_file,
    free_port,
    host_file,
    start,
)
from daemon_rig import Daemon, wait_until
from gantry_device_frames import FRAMES

from motorctl.daemon.client import DaemonRefusedError
from motorctl.hal import Status
from motorctl.log import read_recording
from motorctl.log.sample import AxisState, FaultCause

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

PAUSE_S = 0.3
assert PAUSE_S > WATCHDOG_S
TOLD = {
    Status.AMPLIFIER_FAULT: "since then the amplifier reports a fault",
    Status.COMMUNICATION_LOST: "since then communication with the device is lost",
}
"""What the device said in the tick that tripped, if it was heard by then."""
FEW = ("serial poll", "canopen")
"""A box that switches its amplifiers off by itself, and a drive that goes into Fault."""


def _begin_again(daemon: Daemon, axis: str) -> None:
    def reset() -> bool:
        with suppress(DaemonRefusedError):
            daemon.ask("reset", axis=axis)
            return True
        return False

    wait_until(reset, 5.0)
    start(daemon, axis)
    assert daemon.state(axis) == "running"


@pytest.mark.parametrize(
    "bus_name",
    [name if name in FEW else pytest.param(name, marks=pytest.mark.long) for name in BUSES],
)
def test_a_pause_that_outlasts_the_devices_watchdog_is_told_as_a_pause_and_not_as_its_fault(
    tmp_path: Path, bus_name: str
) -> None:
    bus, port = BUSES[bus_name], free_port()
    with DeviceProcess(tmp_path, device_file(bus, port)) as device:
        config = host_file(bus, bus.driver(device.endpoint, port))
        with Daemon(tmp_path / "daemon", config) as daemon:
            for axis in AXES:
                start(daemon, axis)
            time.sleep(0.5)
            loop = daemon.ask("status")["loop"]["pid"]
            os.kill(loop, signal.SIGSTOP)
            time.sleep(PAUSE_S)
            os.kill(loop, signal.SIGCONT)
            wait_until(lambda: all(daemon.state(axis) == "fault" for axis in AXES), 5.0)
            status = daemon.ask("status")
            for axis in AXES:
                fault = status["axes"][axis]["fault"]
                assert fault["cause"] == "host_frozen", fault
                assert "the loop was stalled for" in fault["message"]
            messages = {axis: status["axes"][axis]["fault"]["message"] for axis in AXES}
            for axis in AXES:
                _begin_again(daemon, axis)
            assert daemon.ask("status")["loop"]["pid"] == loop
            assert daemon.end() == 0, daemon.said
            log = read_recording(daemon.log(), gaps="keep")
            rows = pq.read_table(daemon.log())
        device.end()
    assert device.report["watchdog_trips"] >= 1
    # The pause trips, in its first tick, and nothing goes out any more.
    pause = int(np.argmax(np.diff(log.time_s)))
    assert log.time_s[pause + 1] - log.time_s[pause] > WATCHDOG_S
    for axis in AXES:
        recorded = log.axes[axis]
        assert recorded.state is not None
        assert recorded.fault is not None
        assert recorded.state[pause] == AxisState.RUNNING
        # Where the pause came while the answer was waited for, that tick has it already.
        assert recorded.state[pause + 1] == AxisState.FAULT
        assert recorded.fault[pause + 1] == FaultCause.HOST_FROZEN
        assert recorded.command[pause + 1] == 0.0
        heard = rows[f"{axis}.device_status"].to_numpy()[pause + 1]
        for bit, words in TOLD.items():
            assert (words in messages[axis]) == bool(heard & bit), (messages[axis], Status(heard))


def _narrow_can() -> Bus:
    """Return the CAN bus of the others with counts of 16 bits, which go round every 32.8 mm."""
    frames = copy.deepcopy(FRAMES)
    for name in ("cx", "cy"):
        frames["state"]["signals"][name]["bits"] = 16

    def bus(port: int) -> dict[str, Any]:
        return {**BUSES["can udp_multicast"].driver("", port), "frames": frames}

    def serve(port: int) -> dict[str, Any]:
        served = BUSES["can udp_multicast"].serve(port)["can"]
        return {"can": {**served, "frames": frames}}

    return Bus("narrow can", 250.0, serve, lambda _, port: bus(port), 16)


def test_a_pause_that_a_counter_of_16_bits_behind_a_bus_does_not_stand_is_told_as_the_pause(
    tmp_path: Path,
) -> None:
    bus, port = _narrow_can(), free_port()
    with DeviceProcess(tmp_path, device_file(bus, port)) as device:
        config = yaml.safe_load(host_file(bus, bus.driver(device.endpoint, port)))
        del config["programs"]
        for axis in config["axes"].values():
            del axis["program"]
            axis["limits"] |= {
                "travel_m": [-1e-3, 31e-3],  # what the counter can tell apart
                "max_velocity_m_s": 0.3,
                "following_error": {"minimum_m": 5e-3, "filter_time_s": 0.01},
                "stop": {"acceleration_m_s2": 5, "jerk_m_s3": 400},
            }
        with Daemon(tmp_path / "daemon", yaml.safe_dump(config)) as daemon:
            daemon.hold(*AXES)
            loop = daemon.ask("status")["loop"]["pid"]
            os.kill(loop, signal.SIGSTOP)
            time.sleep(0.085)  # less than its watchdog, host_frozen and hold_ticks stand
            os.kill(loop, signal.SIGCONT)
            wait_until(lambda: all(daemon.state(name) == "fault" for name in AXES), 5.0)
            for name, told in daemon.ask("status")["axes"].items():
                message = told["fault"]["message"]
                assert told["fault"]["cause"] == "host_frozen", message
                assert "the loop was stalled for" in message
                assert "in which the counter may turn a quarter round" in message
                assert "the encoder is in order" in message
                assert message.endswith(f"`motorctl reset {name}` clears the fault")
            daemon.hold(*AXES)
            assert daemon.end() == 0, daemon.said
        device.end()
