"""The scope beside a running machine: every row is heard, and a capture is an ordinary log."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_ring import AXES, Ring, ring
from served_socket import served

import motorctl
from motorctl.daemon.access import Role
from motorctl.daemon.protocol import Request
from motorctl.errors import RunError
from motorctl.log.convert import convert
from motorctl.log.sample import AxisState
from motorctl.loop.layout import signature
from motorctl.scope.live_machine import LiveMachine
from motorctl.scope.signals import signals
from motorctl.scope.trigger import Trigger

pytestmark = pytest.mark.wall_clock(lanes=3)

METADATA = {"rate_hz": 1000.0, "machine": "bench", "config": {"name": "bench"}}
WAIT_S = 20.0


@contextmanager
def staged(
    place: Path, flight_records: dict[str, Any] | None = None
) -> Iterator[tuple[Ring, Path]]:
    """Serve what the scope asks of a daemon, over a ring that a test fills."""
    with ring() as filled:

        async def handle(request: Request) -> dict[str, Any]:
            if request.do == "status":
                loop = {"rate_hz": 1000.0, "pid": 2**22 + 1}  # of no process
                recording = {"file": None, "flight_records": flight_records}
                return {"machine": "bench", "loop": loop, "recording": recording, "axes": {}}
            axes = {a.name: {"theta_names": a.theta_names, "dual_drive": False} for a in AXES}
            layout = filled.memory.layout
            told = {"machine": "bench", "rate_hz": 1000.0, "models_row": 0, "metadata": METADATA}
            return told | {"layout": layout, "signature": signature(layout), "axes": axes}

        with served(place, handle, lambda: Role.OBSERVE, filled.memory.open_to_read) as path:
            yield filled, path


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Ring, LiveMachine]]:
    # The one who tests goes on at the priority that it has.
    monkeypatch.setattr("motorctl.scope.live_machine.keep_off_the_loop_of", lambda path: None)
    with staged(tmp_path / "s") as (filled, path):
        filled.run(500)
        machine = LiveMachine(path, tmp_path / "captures")
        yield filled, machine
        machine.close()


def until(met: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not met():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_it_shows_what_was_before_and_every_row_that_comes(stage: Any) -> None:
    filled, machine = stage
    for _ in range(3):
        filled.run(200)
        time.sleep(0.02)
    until(lambda: machine.state()["end_s"] == pytest.approx(1.099))
    with machine.lock:
        told = signals(machine, ["x.position_m"], 0.0, 2.0, 1000)
    assert told.arrays["time_s"] == pytest.approx(np.arange(1100) / 1000)
    assert told.arrays["x.position_m"] == pytest.approx(1e-3 * np.arange(1100))
    assert machine.state()["lost"] == 0


def test_rows_that_it_was_too_late_for_are_counted(stage: Any) -> None:
    filled, machine = stage
    with machine.lock:  # as a page that holds it up for longer than the loop keeps rows
        filled.run(filled.memory.ring_rows + 700)
        time.sleep(0.2)
        filled.run(filled.memory.ring_rows)
    until(lambda: machine.state()["lost"] > 0)


def test_a_capture_is_a_log_with_the_rows_around_the_trigger(stage: Any, tmp_path: Path) -> None:
    filled, machine = stage
    machine.arm(Trigger(kind="fault", pre_s=0.3, post_s=0.1))
    filled.run(200)
    filled.run(50, AxisState.FAULT)
    time.sleep(0.1)
    assert machine.state()["captured"] == 0, "the seconds after it are not there yet"
    filled.run(200, AxisState.FAULT)
    until(lambda: machine.state()["captured"] == 1)
    state = machine.state()
    assert state["armed"] is None, "a single one"
    (capture,) = state["captures"]
    assert capture["time_s"] == pytest.approx(0.7)
    assert capture["failure"] is None
    log = motorctl.open_log(capture["path"])
    assert log["tick"].tolist() == list(range(400, 801))
    assert log["y.position_m"] == pytest.approx(1e-3 * np.arange(400, 801))
    assert log["x.state"][300] == AxisState.FAULT
    assert (log.metadata["machine"], log.sample_rate_hz) == ("bench", 1000.0)
    assert log.metadata["capture"]["trigger"]["kind"] == "fault"
    assert log.info().faults == ()


def test_a_normal_trigger_captures_again_and_again(stage: Any) -> None:
    filled, machine = stage
    machine.arm(Trigger(kind="program", mode="normal", pre_s=0.05, post_s=0.05))
    for count in (1, 2):
        filled.run(100, AxisState.IDLE)
        time.sleep(0.1)
        filled.run(100)
        until(lambda count=count: machine.state()["captured"] == count)
    paths = [capture["path"] for capture in machine.state()["captures"]]
    assert len(set(paths)) == 2
    assert machine.state()["armed"]["kind"] == "program"
    machine.arm(None)
    assert machine.state()["armed"] is None


def test_captures_of_one_second_are_all_written_though_the_disk_is_slow(
    stage: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slowly(*given: Any) -> Any:
        time.sleep(0.2)
        return convert(*given)

    monkeypatch.setattr("motorctl.log.writer.convert", slowly)
    filled, machine = stage
    machine.arm(Trigger(kind="state", mode="normal", pre_s=0.01, post_s=0.0))
    for state in (AxisState.IDLE, AxisState.RUNNING, AxisState.IDLE):
        filled.run(20, state)
        time.sleep(0.08)
    until(lambda: machine.state()["captured"] == 3)
    captures = machine.state()["captures"]
    assert [capture["failure"] for capture in captures] == [None] * 3
    assert len({capture["path"] for capture in captures}) == 3


def test_what_triggers_again_among_rows_that_come_at_once_is_captured_too(stage: Any) -> None:
    filled, machine = stage
    machine.arm(Trigger(kind="fault", mode="normal", pre_s=0.01, post_s=0.05))
    with machine.lock:  # as a page that holds it up
        for _ in range(2):
            filled.run(100, AxisState.FAULT)
            filled.run(100, AxisState.IDLE)
    until(lambda: machine.state()["captured"] == 2)
    assert [c["time_s"] for c in machine.state()["captures"]] == pytest.approx([0.5, 0.7])


def test_a_capture_that_the_disk_refuses_is_told(stage: Any, tmp_path: Path) -> None:
    filled, machine = stage
    (tmp_path / "captures").write_text("a file where the folder should be")
    machine.arm(Trigger(kind="state", pre_s=0.1, post_s=0.0))
    filled.run(100, AxisState.IDLE)
    until(lambda: machine.state()["captured"] == 1)
    (capture,) = machine.state()["captures"]
    assert capture["path"] is None
    assert "captures" in capture["failure"]


def captured_of_what_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: Callable[[LiveMachine], None]
) -> list[Any]:
    """Return captures where the seconds after the trigger never came, as something ended before."""
    monkeypatch.setattr("motorctl.scope.live_machine.keep_off_the_loop_of", lambda path: None)
    with staged(tmp_path / "s") as (filled, path):
        filled.run(500)
        machine = LiveMachine(path, tmp_path / "captures")
        machine.arm(Trigger(kind="fault", pre_s=0.1, post_s=20.0))
        filled.run(50, AxisState.FAULT)
        until(lambda: machine.state()["end_s"] == pytest.approx(0.549))
        end(machine)
    until(lambda: machine.state()["captured"] == 1)
    machine.close()
    return machine.state()["captures"]


@pytest.mark.parametrize("end", [lambda machine: None, LiveMachine.close], ids=["daemon", "scope"])
def test_what_was_triggered_is_written_though_daemon_or_scope_ends_before_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: Callable[[LiveMachine], None]
) -> None:
    (capture,) = captured_of_what_ends(tmp_path, monkeypatch, end)
    assert capture["failure"] is None
    assert motorctl.open_log(capture["path"])["tick"].tolist() == list(range(400, 550))


def test_a_loop_that_still_compiles_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motorctl.scope.live_machine.keep_off_the_loop_of", lambda path: None)
    monkeypatch.setattr("motorctl.scope.live_machine.FIRST_ROWS_S", 0.3)
    with staged(tmp_path / "s") as (filled, path):
        with pytest.raises(RunError, match=r"its loop has written no row, in 0\.3 s"):
            LiveMachine(path, tmp_path)
        threading.Timer(0.1, filled.run, [10]).start()
        machine = LiveMachine(path, tmp_path)
        assert machine.told()["rows"] == 10
        machine.close()


def test_after_a_restart_it_leaves_the_cpu_of_the_next_loop_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[Path] = []
    monkeypatch.setattr("motorctl.scope.live_machine.keep_off_the_loop_of", left.append)
    monkeypatch.setattr("motorctl.api.samples.AGAIN_S", 0.01)
    with staged(tmp_path / "s") as (filled, path):
        filled.run(500)
        machine = LiveMachine(path, tmp_path)
    assert left == [path]
    with staged(tmp_path / "s") as (filled, path):
        until(lambda: (filled.run(10), machine.state()["run"] == 1)[1])
        until(lambda: left == [path, path])
        machine.close()


def test_without_a_daemon_it_says_so(tmp_path: Path) -> None:
    before = threading.active_count()
    with pytest.raises(RunError, match="no daemon answers"):
        LiveMachine(tmp_path / "none.sock", tmp_path)
    assert threading.active_count() == before
