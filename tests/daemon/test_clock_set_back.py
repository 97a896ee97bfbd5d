"""The computer's clock is set back while a machine runs: the order of what is kept stays right."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from daemon_rig import bench_config, wait_until
from hypothesis import HealthCheck, given
from hypothesis import settings as trying
from hypothesis import strategies as st
from recorded_ring import MACHINE, MUCH, Ring, finished, ring, rotating, settings, ticks_of

from motorctl.config import load
from motorctl.config.machine import MOST_PARAMETERS
from motorctl.daemon.flight_recorder import FlightRecorder
from motorctl.flight import list_records
from motorctl.log.folder import Retention, free_log_path, remove_outdated, stored_logs
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory

NOON = datetime(2026, 6, 1, 12, 0, 0, tzinfo=UTC)
HOUR = timedelta(hours=1)


class Clock:
    """A wall clock that goes on by a minute a look, and can be set."""

    def __init__(self) -> None:
        self.time = NOON

    def __call__(self) -> datetime:
        self.time += timedelta(minutes=1)
        return self.time


@pytest.fixture
def bench() -> Iterator[Ring]:
    with ring() as made:
        yield made


def recorded(bench: Ring, folder: Path, clock: Clock, back_after: int, logs: int) -> list[Path]:
    """Record a run of so many logs; after some of them the clock is set back by an hour."""
    sealed: list[Path] = []
    keys = settings(rotate={"max_size_mb": 1})
    log = rotating(folder, keys, sealed.append, now=clock)
    while log.part < logs:
        if log.part == back_after:
            clock.time -= HOUR
            back_after = -1
        bench.run(1000)
        log.append(*bench.take())
    made = finished(sealed)
    return [*made, log.close({})]


def test_logs_keep_their_order_and_it_is_told_once(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "motorctl"):
        logs = recorded(bench, tmp_path, Clock(), back_after=2, logs=6)
    assert [stored.path for stored in stored_logs(tmp_path, MACHINE)] == logs
    ticks = ticks_of(logs)
    assert (np.diff(ticks) == 1).all()
    (told,) = caplog.messages
    assert "the computer's clock is 3540 s before the newest log" in told
    assert "stay in order" in told


def test_names_have_the_time_again_once_the_clock_has_passed_them(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    clock = Clock()
    recorded(bench, tmp_path, clock, back_after=2, logs=4)
    clock.time += 2 * HOUR
    caplog.clear()
    with caplog.at_level(logging.WARNING, "motorctl"):
        (last,) = recorded(bench, tmp_path, clock, back_after=-1, logs=1)
    assert f"{clock.time:%Y%m%dT%H%M%SZ}" in last.name
    assert caplog.messages == []
    assert stored_logs(tmp_path, MACHINE)[-1].path == last


def test_retention_still_removes_the_oldest_rows(bench: Ring, tmp_path: Path) -> None:
    logs = recorded(bench, tmp_path, Clock(), back_after=3, logs=6)
    sizes = [log.stat().st_size for log in logs]
    limits = Retention(max_total_bytes=float(sum(sizes[2:])))
    removed = remove_outdated(tmp_path, MACHINE, limits, NOON.timestamp(), lambda: MUCH)
    assert [gone.path for gone in removed] == logs[:2]


def test_a_clock_that_was_set_back_makes_no_log_older_than_its_age_allows(
    bench: Ring, tmp_path: Path
) -> None:
    logs = recorded(bench, tmp_path, Clock(), back_after=-1, logs=3)
    written_s = max(log.stat().st_mtime for log in logs)
    limits = Retention(max_age_s=86_400.0)
    assert remove_outdated(tmp_path, MACHINE, limits, written_s - 3600.0, lambda: MUCH) == []


@trying(max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(steps=st.lists(st.integers(-10_000, 10_000), min_size=1, max_size=12))
def test_however_the_clock_leaps_a_new_log_is_the_newest(
    tmp_path_factory: pytest.TempPathFactory, steps: list[int]
) -> None:
    folder, when, made = tmp_path_factory.mktemp("leaps"), NOON, []
    for seconds in steps:
        when += timedelta(seconds=seconds)
        path = free_log_path(folder, MACHINE, when)
        path.write_bytes(b"rows")
        made.append(path)
    assert [stored.path for stored in stored_logs(folder, MACHINE)] == made


def test_a_flight_record_is_never_removed_for_being_older_than_those_before(
    tmp_path: Path,
) -> None:
    config = tmp_path / "bench.yaml"
    text = "recording: {flight_recorder: {before_s: 1, after_s: 0, keep_records: 2}}\n"
    config.write_text(bench_config() + text)
    machine = load(config)
    clock = Clock()
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    flight = FlightRecorder(machine, memory, tmp_path, dict, clock)
    written: list[Path] = []
    for number in range(1, 6):
        if number == 3:
            clock.time -= HOUR
        trip(memory, number)
        before = flight.newest
        wait_until(lambda: flight.watch() or flight.newest != before)  # noqa: B023
        assert flight.newest is not None
        written.append(flight.newest)
        assert flight.newest.exists()
    flight.finish()
    memory.close()
    assert [record.path for record in list_records(tmp_path).records] == written[:2:-1]
    # What the clock said stands in the record itself.
    metadata = json.loads(pq.read_schema(written[-1]).metadata[b"motorctl"])
    assert metadata["flight_record"]["written_utc"].startswith(f"{clock.time:%Y-%m-%dT%H:%M}")


def trip(memory: LoopMemory, number: int) -> None:
    """Do to the memory what a loop does in a tick in which every axis trips anew."""
    head = int(memory.status["ring_head"][0])
    row = head % memory.ring_rows
    memory.ticks[row]["tick"] = head
    memory.ticks[row]["time_s"] = float(number)
    memory.status["ring_head"][0] = head + 1
    statuses = memory.axis_status_rows[head % len(memory.axis_status_rows)]
    statuses["state"] = AxisState.FAULT
    statuses["fault"] = FaultCause.ESTOP
    statuses["fault_time_s"] = float(number)
