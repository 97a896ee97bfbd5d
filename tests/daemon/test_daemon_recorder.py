"""From the ring to the log: no row is lost in silence."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from daemon_rig import bench_config, wait_until
from recorded_ring import ring

from motorctl.config import load
from motorctl.daemon.recorder import Recorder
from motorctl.daemon.report import Report
from motorctl.errors import RunError
from motorctl.log import LogAxis, LogWriter, recover
from motorctl.loop import LoopMemory

pytestmark = pytest.mark.slow


@pytest.fixture
def memory() -> Iterator[LoopMemory]:
    made = LoopMemory.create(["x"], 1, 100.0)
    yield made
    made.close()


def tick(memory: LoopMemory, count: int) -> None:
    """Do what the loop does to the ring, for so many ticks."""
    head = int(memory.status["ring_head"][0])
    for number in range(head, head + count):
        row = number % memory.ring_rows
        memory.ticks[row]["tick"] = number
        memory.ticks[row]["time_s"] = number * 0.01
        memory.ticks[row]["turnaround_s"] = 1e-5 if number != 7 else 3e-3
        memory.samples[row, 0]["position_m"] = 1e-3 * number
    memory.status["ring_head"][0] = head + count


def recorder(memory: LoopMemory, folder: Path) -> Recorder:
    writer = LogWriter(folder / "run.parquet", {"machine": "bench"}, [LogAxis("x", ("inertia",))])
    return Recorder(memory, writer)


def test_every_row_reaches_the_log(memory: LoopMemory, tmp_path: Path) -> None:
    recording = recorder(memory, tmp_path)
    recording.start()
    tick(memory, 500)
    wait_until(lambda: recording.rows_written == 500)
    tick(memory, 250)
    path = recording.finish(lambda: {"rows_lost": recording.rows_lost})
    table = pq.read_table(path)
    assert (table["tick"].to_numpy() == np.arange(750)).all()
    assert table["x.position_m"][-1].as_py() == pytest.approx(0.749)
    assert (recording.rows_written, recording.rows_lost, recording.failure) == (750, 0, None)
    assert recording.timing.result()["turnaround"]["max_at_s"] == pytest.approx(0.07)


def test_rows_are_on_disk_while_the_recording_goes_on(memory: LoopMemory, tmp_path: Path) -> None:
    recording = recorder(memory, tmp_path)
    recording.start()
    tick(memory, 300)
    wait_until(lambda: recording.rows_written == 300)
    copy = tmp_path / "copy.parquet.partial"
    copy.write_bytes((tmp_path / "run.parquet.partial").read_bytes())
    assert recover(copy).rows == 300
    recording.finish(dict)


def test_the_status_names_the_log_so_that_it_is_found_from_every_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bench.yaml").write_text(bench_config())
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    machine = load(Path("bench.yaml"))
    with ring() as filled:
        report = Report(machine, filled.memory, Path("s"))
        report.recorder = recorder(filled.memory, Path("logs"))
        told = report.document([], {})["recording"]["file"]
        assert told == str(tmp_path / "logs" / "run.parquet")
        report.recorder.finish(dict)


def test_rows_that_were_overwritten_are_counted(memory: LoopMemory, tmp_path: Path) -> None:
    recording = recorder(memory, tmp_path)
    tick(memory, memory.ring_rows + 100)
    recording.start()
    path = recording.finish(lambda: {"rows_lost": recording.rows_lost})
    table = pq.read_table(path)
    assert recording.rows_lost >= 100
    assert table.num_rows + recording.rows_lost == memory.ring_rows + 100
    assert (np.diff(table["tick"].to_numpy()) == 1).all()
    metadata = json.loads(table.schema.metadata[b"motorctl"])
    assert metadata["rows_lost"] == recording.rows_lost


def test_rows_that_the_disk_refuses_are_counted_and_the_next_are_tried(
    memory: LoopMemory, tmp_path: Path
) -> None:
    resource = pytest.importorskip("resource")
    recording = recorder(memory, tmp_path)
    recording.start()
    tick(memory, 100)
    wait_until(lambda: recording.rows_written == 100)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    full = (tmp_path / "run.parquet.partial").stat().st_size
    assert signal.getsignal(signal.SIGXFSZ) is signal.SIG_IGN
    resource.setrlimit(resource.RLIMIT_FSIZE, (full, hard))
    try:
        tick(memory, 40)
        wait_until(lambda: recording.rows_lost == 40)
        assert recording.failure is not None
        assert "run.parquet.partial: cannot be written" in recording.failure
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    tick(memory, 60)
    wait_until(lambda: recording.rows_written == 160)
    assert recording.failure is None
    assert "cannot be written" in str(recording.lost_because)
    path = recording.finish(dict)
    assert (pq.read_table(path)["tick"].to_numpy() == [*range(100), *range(140, 200)]).all()


@pytest.mark.parametrize("mistake", [MemoryError(), OSError("no more"), ValueError("odd")])
def test_whatever_fails_costs_those_rows_and_no_others(
    memory: LoopMemory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mistake: Exception
) -> None:
    def broken(*arguments: object) -> bytes:
        raise mistake

    recording = recorder(memory, tmp_path)
    recording.start()
    with monkeypatch.context() as patched:
        patched.setattr("motorctl.log.writer.encode_batch", broken)
        tick(memory, 40)
        wait_until(lambda: recording.rows_lost == 40)
        wait_until(lambda: recording.failure is not None)
        assert type(mistake).__name__ in str(recording.failure)
    tick(memory, 60)
    wait_until(lambda: recording.rows_written == 60)
    wait_until(lambda: recording.failure is None)
    path = recording.finish(lambda: {"rows_lost": recording.rows_lost})
    table = pq.read_table(path)
    assert (table["tick"].to_numpy() == np.arange(40, 100)).all()
    assert json.loads(table.schema.metadata[b"motorctl"])["rows_lost"] == 40


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_recorder_whose_thread_died_is_told_and_records_on(
    memory: LoopMemory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def deadly() -> None:
        raise SystemExit  # ends a thread without a word

    recording = recorder(memory, tmp_path)
    before = set(threading.enumerate())
    with monkeypatch.context() as patched:
        patched.setattr(memory, "drain", deadly)
        recording.start()
        wait_until(lambda: set(threading.enumerate()) <= before)
    tick(memory, 50)
    recording.insist()
    assert "recorder's thread ended" in str(recording.failure)
    wait_until(lambda: recording.rows_written == 50)
    assert pq.read_table(recording.finish(dict)).num_rows == 50


def test_a_log_that_cannot_be_closed_is_told_and_kept(memory: LoopMemory, tmp_path: Path) -> None:
    recording = recorder(memory, tmp_path)
    recording.start()
    tick(memory, 10)
    (tmp_path / "run.parquet").mkdir()
    (tmp_path / "run.parquet" / "in the way").write_text("")
    with pytest.raises(RunError, match="cannot be finished"):
        recording.finish(dict)
    assert recover(tmp_path / "run.parquet.partial", tmp_path / "saved.parquet").rows == 10
