"""The shipped configurations of a bus, each with the shipped device at the other end."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from buses_bench import DeviceProcess, free_port
from daemon_rig import Daemon, wait_until

from motorctl.config import load, summarise
from motorctl.config.shipped import shipped_config
from motorctl_devices.load import SHIPPED

RUN_S = 2.0
NO_SWITCHES = "no limit_negative and limit_positive for x, y"
ADVICE = {
    "serial": [],
    "can": [NO_SWITCHES],
    "canopen": [NO_SWITCHES],
    "modbus": ["coupler generic has no watchdog that is known", NO_SWITCHES],
}


def _files(bus: str, device: str, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return both files, on ports and a group of this test's own."""
    host = yaml.safe_load(shipped_config(f"{bus}_gantry").read_text())
    served = yaml.safe_load((SHIPPED / f"{device}.yaml").read_text())
    driver = host["drivers"]["gantry"]
    if driver["type"] == "serial":
        driver["port"] = str(folder / "link")
    elif bus in ("can", "canopen"):
        port = free_port()
        driver["port"] = served["serve"][bus]["port"] = port
    else:
        port = free_port()
        driver["tcp"]["port"] = served["serve"]["modbus"]["tcp"]["port"] = port
    return host, served


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
@pytest.mark.parametrize(
    ("bus", "device"),
    [
        ("serial", "serial_box"),
        ("canopen", "canopen_drives"),
        pytest.param("dual_serial", "dual_serial_box", marks=pytest.mark.long),
        pytest.param("can", "can_node", marks=pytest.mark.long),
        pytest.param("modbus", "modbus_coupler", marks=pytest.mark.long),
    ],
)
def test_a_shipped_pair_follows_its_programs(tmp_path, bus, device):
    host, served = _files(bus, device, tmp_path)
    link = tmp_path / "link" if host["drivers"]["gantry"]["type"] == "serial" else None
    axes = list(host["axes"])
    with (
        DeviceProcess(tmp_path, served, link) as process,
        Daemon(tmp_path / "daemon", yaml.safe_dump(host)) as daemon,
    ):
        for axis in axes:
            if host["axes"][axis]["homing"]["method"] != "absolute":
                daemon.ask("home", axis=axis)
                wait_until(lambda axis=axis: daemon.ask("status")["axes"][axis]["homed"], 30.0)
            daemon.ask("start", axis=axis)
            wait_until(lambda axis=axis: daemon.state(axis) == "running", 10.0)
        time.sleep(RUN_S)
        assert {daemon.state(axis) for axis in axes} == {"running"}
        assert daemon.end() == 0
        process.end()
    assert process.report["watchdog_trips"] == 0
    assert process.report["refused"] == 0


@pytest.mark.parametrize("bus", ["serial", "can", "canopen", "modbus"])
def test_a_shipped_configuration_declares_the_delay_of_its_exchange(bus):
    machine = load(f"{bus}_gantry")
    told = summarise(machine)
    (driver,) = told["drivers"].values()
    for axis in machine.axes.values():
        assert axis.model.delay_s == driver["delay_s"]
    assert [said.partition(":")[0] for said in driver["advice"]] == ADVICE[bus]


def test_the_shipped_drives_on_canopen_have_45_degrees_of_phase_and_30_with_a_sample_more():
    told = summarise(load("canopen_gantry"))
    for axis in told["axes"].values():
        here = [row for row in axis["margins"] if row["inertia_at"] == "initial"]
        assert [row["stable"] for row in axis["margins"]] == [True] * 6
        assert here[0]["phase_margin_deg"] >= 45.0
        assert here[1]["phase_margin_deg"] >= 30.0
        assert min(row["gain_margin"] for row in here) > 2.0
