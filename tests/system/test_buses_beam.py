"""A beam with two motors behind each bus: homed by both ends' switches, squared, stopped as one."""

from __future__ import annotations

import time

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from buses_bench import DeviceProcess, free_port
from daemon_rig import Daemon, wait_until

from motorctl.hal import Status
from motorctl.log.sample import AxisState
from motorctl_benchmarks.buses.beams import BEAM_BUSES, beam_device, beam_host

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

FEW = ("serial poll", "can")
"""Buses of which a beam is tried each time, the others before a release: of each kind one, a bus
that is asked and one that tells by itself."""
FAULT_S = 12.0
"""After the search began: the beam is homed and on its way."""
SQUARE_COUNTS = 200
"""0.1 mm: what the switches' ticks and the rest of a motion leave of skew."""
ASKEW_COUNTS = 600
"""By so much the first end is ahead where the device is switched on."""


@pytest.mark.parametrize(
    "bus",
    [
        pytest.param(bus, id=name, marks=() if name in FEW else pytest.mark.long)
        for name, bus in BEAM_BUSES.items()
    ],
)
def test_a_beam_behind_a_bus_homes_both_ends_and_stops_for_either(tmp_path, bus):
    port = free_port()
    broken = {"kind": "amplifier_fault", "channel": 1, "at_s": FAULT_S}
    with DeviceProcess(tmp_path, beam_device(bus, port, [broken])) as device:
        config = yaml.safe_dump(beam_host(bus, device.endpoint, port))
        with Daemon(tmp_path / "daemon", config) as daemon:
            began = time.monotonic()
            daemon.ask("home", axis="x")
            wait_until(lambda: daemon.ask("status")["axes"]["x"]["homed"], FAULT_S)
            assert daemon.state("x") == "idle"
            daemon.ask("start", axis="x")
            wait_until(lambda: daemon.state("x") == "running", FAULT_S)
            assert time.monotonic() - began < FAULT_S - 3.0  # two cycles are to come
            wait_until(lambda: daemon.state("x") == "fault", FAULT_S)
            told = daemon.ask("status")["axes"]["x"]
            assert daemon.end() == 0
            log = pq.read_table(daemon.log())
        device.end()
    assert told["fault"]["cause"] == "amplifier"
    assert "at the second end of the beam" in told["fault"]["message"]
    assert device.report["watchdog_trips"] == 0

    # Both ends were led to square by the counts that the machine itself saw.
    ways = [most for _, most in device.report["travelled_counts"]]
    assert abs(ways[0] - ways[1] + ASKEW_COUNTS) < SQUARE_COUNTS

    def column(signal):
        return log[f"x.{signal}"].to_numpy()

    state, second = column("state"), column("second_device_status")
    running = state == AxisState.RUNNING
    assert np.abs(column("following_error_m")[running]).max() < 0.02
    assert np.abs(column("skew_m")[running]).max() < 2e-3
    assert np.all(second[running] & Status.AMPLIFIER_FAULT == 0)
    faulty = state == AxisState.FAULT
    assert second[faulty][0] & Status.AMPLIFIER_FAULT
    assert np.all(column("command_v")[faulty] == 0.0)
    assert np.all(column("skew_command_v")[faulty] == 0.0)
