"""A bus that was lost comes back on `motorctl reset`: the daemon and other drivers' axes go on."""

from __future__ import annotations

import os
import time
import tty
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from buses_bench import (
    AXES,
    BUSES,
    END_S,
    HOLD_S,
    DeviceProcess,
    Options,
    device_file,
    free_port,
    host_file,
)
from daemon_rig import Daemon, wait_until

from motorctl.daemon.client import DaemonRefusedError
from motorctl.log import Recording, read_recording
from motorctl.log.sample import AxisState

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

SERIAL = BUSES["serial exchange"]
CONNECT_S = 1.0
"""How long the serial driver waits for its device when it is opened."""
UNPLUG_AT_S, AWAY_S = 4.0, 2.0
CHANNELS = device_file(SERIAL, 0)["channels"]
HOMING = {
    "method": "switch",
    "search_velocity_m_s": -0.05,
    "latch_velocity_m_s": 0.02,
    "home_position_m": -0.02,
    "timeout_s": 20.0,
}


def _refusal(daemon: Daemon, do: str, axis: str, **arguments: Any) -> str:
    with pytest.raises(DaemonRefusedError) as no:
        daemon.ask(do, axis=axis, **arguments)
    return str(no.value)


def _beside_a_simulated_axis(endpoint: Path) -> str:
    """Return the configuration of x on a serial box, to be homed, and y on a driver of its own."""
    options = SERIAL.driver(str(endpoint), 0) | {"connect_s": CONNECT_S}
    data = yaml.safe_load(host_file(SERIAL, options))
    sim = {"type": "sim", "preset": "published_gantry", "seed": 1}
    data["drivers"] = {"box": data["drivers"].pop("gantry"), "own": sim}
    data["axes"]["x"] |= {"driver": "box", "homing": HOMING}
    data["axes"]["y"] |= {"driver": "own"}
    data["axes"]["x"].pop("program")
    return yaml.safe_dump(data)


@contextmanager
def _daemon(folder: Path, config: str) -> Iterator[Daemon]:
    with Daemon(folder / "daemon", config) as daemon:
        yield daemon
        assert daemon.end() == 0
        assert "Traceback" not in daemon.said
        assert "NOT be safe" not in daemon.said


@contextmanager
def _device(folder: Path, link: Path, *faults: Options, **changes: Any) -> Iterator[DeviceProcess]:
    with DeviceProcess(folder, device_file(SERIAL, 0, faults) | changes, link) as device:
        yield device
        device.end()


def _home(daemon: Daemon, axis: str) -> None:
    daemon.ask_when_it_stands("home", axis)
    wait_until(lambda: daemon.state(axis) != "homing", 20.0)
    told = daemon.ask("status")["axes"][axis]
    assert (told["state"], told["homed"]) == ("idle", True), told


def _ran_on(log: Recording, axis: str) -> None:
    """See that an axis was running from its start to its end, tick by tick."""
    state = log.axes[axis].state
    assert state is not None
    running = np.flatnonzero(state == AxisState.RUNNING)
    whole = slice(running[0], running[-1] + 1)
    assert (state[whole] == AxisState.RUNNING).all()
    assert log.axes[axis].fault is not None
    assert not log.axes[axis].fault.any()
    # Far below what an `open` waits for: the loop did not wait with it.
    assert np.diff(log.time_s[whole]).max() < HOLD_S
    late = log.lateness_s
    assert late is not None
    assert np.quantile(late[whole], 0.99) < 5e-3


def test_a_lost_serial_port_comes_back_on_reset_while_the_other_driver_runs_on(
    tmp_path: Path,
) -> None:
    link = tmp_path / "link"
    unplug = {"kind": "unplug", "at_s": UNPLUG_AT_S, "duration_s": AWAY_S}
    with (
        _device(tmp_path, link, unplug),
        _daemon(tmp_path, _beside_a_simulated_axis(link)) as daemon,
    ):
        daemon.ask_when_it_stands("start", "y")
        _home(daemon, "x")
        # The device's clock of faults began with the homing.
        wait_until(lambda: daemon.state("x") == "fault", END_S)
        lost = daemon.ask("status")["axes"]["x"]
        refused = _refusal(daemon, "reset", "x")
        assert "driver box could not be opened anew" in refused
        assert f"port {link}: No such file or directory" in refused
        assert "`motorctl reset x` tries again" in refused
        wait_until(link.exists, AWAY_S + END_S)
        answer = daemon.ask("reset", axis="x")
        assert answer["opened"] == "box"
        back = daemon.ask("status")["axes"]["x"]
        assert (back["state"], back["homed"], back["device"]) == ("off", False, None)
        assert back["theta_hat"] == lost["theta_hat"]
        daemon.ask_when_it_stands("start", "x")
        assert "axis x is not homed" in _refusal(daemon, "move", "x", position_m=0.05)
        _home(daemon, "x")
        daemon.ask("move", axis="x", position_m=0.05)
        wait_until(lambda: daemon.state("x") == "idle", END_S)
        assert abs(daemon.ask("status")["axes"]["x"]["position_m"] - 0.05) < 5e-3
        daemon.ask("stop", axis="y")
        daemon.ask("stop", axis="x")
    log = read_recording(daemon.log(), gaps="keep")
    _ran_on(log, "y")


@contextmanager
def _mute(port: Path) -> Iterator[None]:
    """Put a serial port there at which nobody answers."""
    master, slave = os.openpty()
    tty.setraw(slave)
    port.unlink(missing_ok=True)
    port.symlink_to(os.ttyname(slave))
    try:
        yield
    finally:
        os.close(slave)
        os.close(master)


@contextmanager
def _plugged(folder: Path, port: Path, **changes: Any) -> Iterator[None]:
    """Put a device at the other end of the port."""
    box = folder / "box"
    with _device(folder, box, **changes):
        port.unlink(missing_ok=True)
        port.symlink_to(box)
        yield


def test_a_port_without_its_device_is_refused_until_the_right_one_is_back(tmp_path: Path) -> None:
    port = tmp_path / "port"
    with ExitStack() as end:
        with _plugged(tmp_path, port):
            config = _beside_a_simulated_axis(port)
            daemon = end.enter_context(_daemon(tmp_path, config))
            daemon.ask_when_it_stands("start", "y")
        # It tells as well of a port that is lost while the axis is off, and has no fault.
        wait_until(lambda: daemon.ask("status")["axes"]["x"]["device"] is not None)
        assert "`motorctl reset` opens it anew" in _refusal(daemon, "start", "x")
        with _mute(port):
            began = time.monotonic()
            refused = _refusal(daemon, "reset", "x")
            assert time.monotonic() - began >= CONNECT_S
            assert f"no device answered within connect_s: {CONNECT_S:g} s" in refused
        other = {"channels": [{**channel, "counter_bits": 16} for channel in CHANNELS]}
        with _plugged(tmp_path, port, **other):
            for _ in range(2):
                refused = _refusal(daemon, "reset", "x")
                assert "has counters of 16 bits, axis 'x' says counter_bits: 32" in refused
        with _plugged(tmp_path, port):
            assert daemon.ask("reset", axis="x")["opened"] == "box"
            _home(daemon, "x")
            daemon.ask("stop", axis="y")
            daemon.ask("stop", axis="x")
            end.close()
    _ran_on(read_recording(daemon.log(), gaps="keep"), "y")


UNPLUG = {"kind": "unplug", "at_s": 0.6, "duration_s": 1.0}
RESTART = {"kind": "reset", "at_s": 0.6, "duration_s": 0.05}


@pytest.mark.parametrize(
    ("bus_name", "fault"),
    [
        ("modbus tcp", UNPLUG),
        ("modbus rtu", RESTART),
        pytest.param("serial poll", UNPLUG, marks=pytest.mark.long),
        pytest.param("can udp_multicast", RESTART, marks=pytest.mark.long),
        pytest.param("slcan", UNPLUG, marks=pytest.mark.long),
        pytest.param("modbus rtu", UNPLUG, marks=pytest.mark.long),
        pytest.param("serial stream", RESTART, marks=pytest.mark.long),
        pytest.param("modbus tcp", RESTART, marks=pytest.mark.long),
    ],
    ids=lambda value: value if isinstance(value, str) else value["kind"],
)
def test_a_bus_of_two_axes_is_opened_once_and_each_axis_reset_by_itself(
    tmp_path: Path, bus_name: str, fault: Options
) -> None:
    bus, link, port = BUSES[bus_name], tmp_path / "link", free_port()
    linked = link if bus_name not in ("modbus tcp", "can udp_multicast") else None
    with DeviceProcess(tmp_path, device_file(bus, port, [fault]), linked) as device:
        config = host_file(bus, bus.driver(str(linked or device.endpoint), port))
        with _daemon(tmp_path, config) as daemon:
            for axis in AXES:
                daemon.ask_when_it_stands("start", axis)
            wait_until(lambda: all(daemon.state(axis) == "fault" for axis in AXES), END_S)
            time.sleep(float(fault["duration_s"]) + 0.3)
            assert daemon.ask("reset", axis="x")["opened"] == "gantry"
            assert (daemon.state("x"), daemon.state("y")) == ("off", "fault")
            assert "opened" not in daemon.ask("reset", axis="y")
            for axis in AXES:
                daemon.ask_when_it_stands("start", axis)
            time.sleep(0.5)
            assert all(daemon.state(axis) == "running" for axis in AXES)
            assert daemon.said.count("opened anew") == 1
        device.end()
