"""A fault's last seconds reach a log of their own, whatever else happens."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from daemon_rig import bench_config, wait_until

from motorctl.config import load
from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.daemon.flight_recorder import FlightRecorder
from motorctl.flight import list_records, load_record
from motorctl.log import read_recording
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory
from motorctl.loop.vocabulary import STATUS_ROWS

RATE_HZ = 400


class FakeLoop:
    """Does to the memory what a loop does, as fast as a test wants."""

    def __init__(self, machine: Machine) -> None:
        self.memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, RATE_HZ)
        self._faults: dict[int, tuple[FaultCause, float]] = {}

    @property
    def time_s(self) -> float:
        return (int(self.memory.status["ring_head"][0]) - 1) / RATE_HZ

    def run(self, seconds: float) -> None:
        memory = self.memory
        head = int(memory.status["ring_head"][0])
        number = np.arange(head, head + round(seconds * RATE_HZ))
        row = number % memory.ring_rows
        memory.ticks["tick"][row] = number
        memory.ticks["time_s"][row] = number / RATE_HZ
        memory.samples["position_m"][row, 0] = 1e-3 * number
        for axis in range(memory.layout["axes"]):
            state = AxisState.FAULT if axis in self._faults else AxisState.RUNNING
            memory.samples["state"][row, axis] = state
        memory.status["ring_head"][0] = number[-1] + 1
        self._tell()

    def trip(self, axis: int, cause: FaultCause, value: float = 2e-3, limit: float = 1e-3) -> None:
        self._faults[axis] = (cause, self.time_s + 1 / RATE_HZ)
        self._numbers = (value, limit)
        self.run(1 / RATE_HZ)

    def reset(self) -> None:
        self._faults.clear()
        self.run(1 / RATE_HZ)

    def _tell(self) -> None:
        memory = self.memory
        newest = (int(memory.status["ring_head"][0]) - 1) % memory.ring_rows % STATUS_ROWS
        statuses = memory.axis_status_rows[newest]
        statuses["state"] = AxisState.RUNNING
        for axis, (cause, time_s) in self._faults.items():
            status = statuses[axis]
            status["state"], status["fault"] = AxisState.FAULT, cause
            status["fault_value"], status["fault_limit"] = self._numbers
            status["fault_time_s"] = time_s


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return with_settings(tmp_path, "{before_s: 2, after_s: 0.1}")


def with_settings(folder: Path, settings: str) -> Machine:
    config = bench_config() + f"recording: {{flight_recorder: {settings}}}\n"
    (folder / "bench.yaml").write_text(config)
    return load(str(folder / "bench.yaml"))


@pytest.fixture
def loop(machine: Machine) -> Iterator[FakeLoop]:
    made = FakeLoop(machine)
    yield made
    made.memory.close()


def recorder(machine: Machine, loop: FakeLoop, folder: Path) -> FlightRecorder:
    return FlightRecorder(machine, loop.memory, folder, lambda: {"loop": {}, "motions": []})


def record_of(flight: FlightRecorder) -> Path:
    """Watch until the record of the fault that just happened is written."""
    before = flight.newest

    def written() -> bool:
        flight.watch()
        return flight.newest != before or flight.failure is not None

    wait_until(written)
    assert flight.failure is None
    assert flight.newest is not None
    return flight.newest


def own(path: Path) -> dict[str, Any]:
    metadata = json.loads(pq.read_schema(path).metadata[b"motorctl"])
    found: dict[str, Any] = metadata["flight_record"]
    return found


def test_the_seconds_around_a_fault_are_kept_at_full_rate(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    loop.run(5.0)
    flight.watch()
    assert flight.newest is None
    loop.trip(0, FaultCause.FOLLOWING_ERROR)
    tripped_s = loop.time_s
    flight.watch()
    loop.run(0.5)
    path = record_of(flight)
    times = pq.read_table(path)["time_s"].to_numpy()
    assert np.allclose(np.diff(times), 1 / RATE_HZ)
    assert times[0] == pytest.approx(tripped_s - 2.0, abs=1.5 / RATE_HZ)
    assert times[-1] == pytest.approx(tripped_s + 0.1, abs=1.5 / RATE_HZ)
    states = pq.read_table(path)["x.state"].to_numpy()
    assert times[np.argmax(states == AxisState.FAULT)] == pytest.approx(tripped_s)


def test_a_record_is_an_ordinary_log_that_tells_cause_configuration_and_versions(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    loop.run(5.0)
    loop.trip(1, FaultCause.OVERSPEED, value=1.5, limit=1.2)
    path = record_of(flight)
    assert path.parent == tmp_path / "faults"
    assert path.name.endswith("-y-overspeed.parquet")
    recording = read_recording(path)
    assert set(recording.axes) == {"x", "y"}
    record = load_record(path)
    assert record.metadata["config"] == machine.resolved
    assert record.message == "speed 1.5 m/s, limit 1.2 m/s, at 5.000 s"
    assert {"numba", "numpy"} <= set(record.own["libraries"])
    assert record.metadata["rows_lost"] == 0


def test_axes_that_trip_together_share_a_record_that_begins_with_the_cause(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    loop.run(3.0)
    loop.trip(1, FaultCause.SOFT_LIMIT)
    flight.watch()
    loop.trip(0, FaultCause.PARTNER, value=1.0)
    path = record_of(flight)
    flight.finish()
    assert list(own(path)["faults"]) == ["y", "x"]
    assert own(path)["cause"] == "soft_limit"
    assert len(list_records(tmp_path).records) == 1


def test_every_fault_after_a_reset_has_a_record_of_its_own_and_a_lasting_one_has_one(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    loop.run(3.0)
    loop.trip(0, FaultCause.ESTOP)
    record_of(flight)
    loop.run(1.0)
    flight.watch()
    assert len(list_records(tmp_path).records) == 1
    loop.reset()
    flight.watch()
    loop.trip(0, FaultCause.ESTOP)
    record_of(flight)
    flight.finish()
    listing = list_records(tmp_path)
    assert len({record.path for record in listing.records}) == 2
    assert listing.records[0].time_s > listing.records[1].time_s


def test_the_end_of_the_daemon_does_not_wait_for_the_seconds_after_a_fault(
    tmp_path: Path,
) -> None:
    machine = with_settings(tmp_path, "{before_s: 1, after_s: 1}")
    loop = FakeLoop(machine)
    flight = recorder(machine, loop, tmp_path)
    loop.run(3.0)
    loop.trip(0, FaultCause.ESTOP)
    flight.watch()
    flight.finish()
    loop.memory.close()
    assert flight.newest is not None
    assert own(flight.newest)["cause"] == "estop"


def test_a_loop_that_ends_without_a_fault_leaves_a_record_too(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    loop.run(5.0)
    flight.finish("the loop process was killed by signal 9")
    assert flight.newest is not None
    assert flight.newest.name.endswith("Z-loop_ended.parquet")
    record = load_record(flight.newest)
    assert (record.first_axis, record.cause) == (None, "loop_ended")
    assert record.message == "the loop process was killed by signal 9"
    assert record.rows == pytest.approx(2 * RATE_HZ, abs=2)


def test_a_loop_that_never_ticked_or_ended_in_order_leaves_none(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    recorder(machine, loop, tmp_path).finish("the drivers could not be opened")
    loop.run(1.0)
    recorder(machine, loop, tmp_path).finish()
    assert not (tmp_path / "faults").exists()


def test_a_disk_that_refuses_the_record_is_told_and_the_next_fault_is_kept(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    (tmp_path / "faults").write_text("in the way")
    loop.run(3.0)
    loop.trip(0, FaultCause.ESTOP)
    wait_until(lambda: flight.watch() or flight.failure is not None)
    assert flight.failure is not None
    assert "faults" in flight.failure
    (tmp_path / "faults").unlink()
    loop.reset()
    flight.watch()
    loop.trip(0, FaultCause.AMPLIFIER)
    wait_until(lambda: flight.watch() or flight.newest is not None)
    assert flight.failure is None


def test_the_oldest_records_are_removed_and_nothing_else_in_the_folder(tmp_path: Path) -> None:
    machine = with_settings(tmp_path, "{before_s: 1, after_s: 0, keep_records: 2}")
    loop = FakeLoop(machine)
    flight = recorder(machine, loop, tmp_path)
    loop.run(3.0)
    written = []
    for _ in range(4):
        loop.trip(0, FaultCause.ESTOP)
        written.append(record_of(flight))
        (tmp_path / "faults" / "notes.parquet").write_text("mine")
        loop.reset()
        flight.watch()
    flight.finish()
    loop.memory.close()
    kept = [record.path for record in list_records(tmp_path).records]
    assert kept == written[:1:-1]
    assert (tmp_path / "faults" / "notes.parquet").exists()


def test_a_value_that_is_no_number_is_told_as_none(
    machine: Machine, loop: FakeLoop, tmp_path: Path
) -> None:
    flight = recorder(machine, loop, tmp_path)
    loop.run(3.0)
    loop.trip(0, FaultCause.NOT_A_NUMBER, value=math.nan, limit=math.inf)
    fault = own(record_of(flight))["faults"]["x"]
    assert (fault["value"], fault["limit"]) == (None, None)
