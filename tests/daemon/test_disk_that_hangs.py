"""A disk that takes nothing for a while: it is told meanwhile, and so is what it cost."""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow.parquet as pq
import pytest
from daemon_rig import bench_config, wait_until
from recorded_ring import Ring, metadata_of, ring, rotating, settings

from motorctl.config import load
from motorctl.config.machine import Machine
from motorctl.daemon import spell, supervisor
from motorctl.daemon.client import Client
from motorctl.daemon.last_run import LastRun
from motorctl.daemon.paths import run_file
from motorctl.daemon.recorder import Recorder
from motorctl.daemon.recording_watch import RecordingWatch
from motorctl.daemon.report import Report
from motorctl.errors import RunError


class Disk:
    """Whose synchronising does not come back while it hangs."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._well = threading.Event()
        self._well.set()
        self.waits = threading.Event()
        self._sync = os.fdatasync
        monkeypatch.setattr("motorctl.log.writer.os.fdatasync", self)

    def __call__(self, file: int) -> None:
        if not self._well.is_set():
            self.waits.set()
        self._well.wait()
        self._sync(file)

    def hang(self) -> None:
        self._well.clear()

    def go_on(self) -> None:
        self._well.set()
        self.waits.clear()


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    made = Disk(monkeypatch)
    yield made
    made.go_on()


class Recording:
    """A recorder on a disk, its watch, and the time that passes between two looks."""

    def __init__(self, bench: Ring, folder: Path) -> None:
        log = rotating(folder, settings(), lambda _: None, lost=lambda: self.recorder.rows_lost)
        self.now_s = 0.0
        self.recorder = Recorder(bench.memory, log)
        self.watch = RecordingWatch(self.recorder, bench.memory, bench.rate_hz, lambda: self.now_s)
        self.bench = bench

    def seconds(self, count: int) -> None:
        """Let the loop tick, and look often, for so many seconds of what the clock says."""
        for _ in range(4 * count):
            self.bench.run(round(self.bench.rate_hz / 4))
            self.now_s += 0.25
            self.watch.look()

    def wait_until_all_is_written(self) -> None:
        recorder, memory = self.recorder, self.bench.memory
        wait_until(lambda: recorder.rows_written + recorder.rows_lost == self.bench.rows)
        progress = recorder.progress
        wait_until(lambda: recorder.progress > progress)
        assert memory.overwritten == 0


@pytest.fixture
def recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, disk: Disk) -> Iterator[Recording]:
    monkeypatch.setattr(spell, "WELL_FOR_S", 0.0)
    with ring() as bench:
        made = Recording(bench, tmp_path)
        made.recorder.start()
        bench.run(100)
        made.wait_until_all_is_written()
        disk.hang()
        bench.run(1)
        assert disk.waits.wait(10.0)
        made.watch.look()
        yield made
        disk.go_on()
        made.recorder.finish(dict)


def test_a_disk_that_takes_nothing_is_told_once_with_what_memory_still_holds(
    recording: Recording, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "motorctl"):
        recording.seconds(1)
        assert (recording.watch.failure, caplog.messages) == (None, [])
        recording.seconds(4)
        assert recording.watch.failure is not None
        assert "taken nothing for 5.0 s" in recording.watch.failure
        assert "memory holds the rows of 3.0 s more" in recording.watch.failure
        (message,) = caplog.messages
        assert message.startswith("recording: the disk has taken nothing for 2.0 s; memory holds")
        disk.go_on()
        recording.wait_until_all_is_written()
        recording.seconds(1)
        recording.wait_until_all_is_written()
    assert caplog.messages[1:] == ["recording resumed; no row was lost"]
    assert (recording.watch.rows_lost, recording.watch.failure) == (0, None)


def test_rows_that_memory_held_no_longer_are_told_while_they_are_lost_and_in_the_end(
    recording: Recording, disk: Disk, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "bench.yaml").write_text(bench_config())
    report = Report(load(tmp_path / "bench.yaml"), recording.bench.memory, Path("s"))
    report.recorder, report.recording_watch = recording.recorder, recording.watch
    with caplog.at_level(logging.INFO, "motorctl"):
        recording.seconds(11)
        held = recording.bench.memory.ring_rows
        lost = 11_000 - held + 1
        told = report.document([], {})["recording"]
        assert told["rows_lost"] == lost
        assert f"memory is full: rows are being lost, {lost} so far" in told["failure"]
        assert [record.levelno for record in caplog.records] == [logging.WARNING, logging.ERROR]
        time.sleep(1.0)  # the recorder's own clock is the computer's
        disk.go_on()
        recording.wait_until_all_is_written()
        recording.seconds(1)
        recording.wait_until_all_is_written()
        recording.seconds(1)
    because, over = caplog.messages[2:]
    assert because.startswith(f"recording: {lost} rows were lost: memory holds the rows of 8.")
    assert "the disk took" in because
    assert over == f"recording resumed; {lost} rows were lost"
    told = report.document([], {})["recording"]
    assert (told["rows_lost"], told["failure"]) == (lost, None)
    assert "the disk took" in told["lost_because"]
    assert metadata_of(recording.recorder.finish(lambda: {"rows_lost": lost}))["rows_lost"] == lost


def test_a_process_that_stood_still_itself_tells_nothing_of_the_disk(
    recording: Recording, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "motorctl"):
        for _ in range(5):
            recording.now_s += 5.0
            recording.watch.look()
    assert caplog.messages == []


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_recorder_that_cannot_be_started_again_is_not_told_as_a_disk_that_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def deadly() -> None:
        raise SystemExit  # ends a thread without a word

    def refused(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with ring() as bench:
        made = Recording(bench, tmp_path)
        with monkeypatch.context() as patched:
            patched.setattr(bench.memory, "drain", deadly)
            made.recorder.start()
            wait_until(lambda: not made.recorder.runs)
        with monkeypatch.context() as patched:
            patched.setattr(threading.Thread, "start", refused)
            for _ in range(5):
                made.recorder.insist()
                made.seconds(1)
        told = str(made.watch.failure)
        assert "nothing was recorded for 5.0 s" in told
        assert "cannot be started again: can't start new thread" in told
        assert "memory holds the rows of 3.0 s more" in told
        assert "disk" not in told
        made.recorder.insist()
        made.wait_until_all_is_written()
        made.seconds(1)
        assert made.watch.failure is None
        made.recorder.finish(dict)


def test_rows_that_nobody_fetched_are_told_with_another_reason_than_the_disk(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with ring() as bench, caplog.at_level(logging.INFO, "motorctl"):
        made = Recording(bench, tmp_path)
        for rows in (100, bench.memory.ring_rows + 100, 10):
            bench.run(rows)
            time.sleep(0.5)  # much longer than writing them takes
            made.recorder._take()
            made.watch.look()
        (message,) = caplog.messages
        assert message.startswith("recording: 101 rows were lost: memory holds the rows of 8.")
        assert "the supervisor fetched none" in message
        made.recorder.finish(dict)


Status = dict[str, Any]


def run_and_play(
    folder: Path, monkeypatch: pytest.MonkeyPatch, play: Callable[[Callable[[], Status]], None]
) -> tuple[str, Machine]:
    """Run a daemon as long as `play` plays with it; return what it ends with, and its machine."""

    def playing() -> None:
        wait_until(lambda: (folder / "s").exists() and any(folder.glob("*.partial")), 240)
        with Client(folder / "s") as client:
            try:
                wait_until(lambda: client.ask("status")["recording"]["rows"])
                play(lambda: client.ask("status")["recording"])
            finally:
                os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
    (folder / "bench.yaml").write_text(bench_config())
    machine = load(str(folder / "bench.yaml"))
    options = supervisor.DaemonOptions(socket=folder / "s", log_directory=folder)
    player = threading.Thread(target=playing)
    player.start()
    with pytest.raises(RunError) as ended:
        supervisor.run_daemon(machine, options)
    player.join()
    return str(ended.value), machine


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_a_run_that_lost_rows_to_a_hanging_disk_says_so_and_ends_with_it(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    disk: Disk,
    caplog: pytest.LogCaptureFixture,
) -> None:
    seen: list[Status] = []

    def play(recorded: Callable[[], Status]) -> None:
        disk.hang()
        wait_until(lambda: "taken nothing for" in str(recorded()["failure"]))
        wait_until(lambda: recorded()["rows_lost"] > 200, 60)
        seen.append(recorded())
        disk.go_on()
        wait_until(lambda: any("rows were lost: memory" in text for text in caplog.messages))
        seen.append(recorded())

    with caplog.at_level(logging.INFO, "motorctl"):
        ended, machine = run_and_play(tmp_path, monkeypatch, play)
    assert "memory is full" in seen[0]["failure"]
    assert seen[1]["failure"] is None
    told = [text for text in caplog.messages if "taken nothing for" in text]
    assert len(told) == 2, told
    (log,) = tmp_path.glob("*.parquet")
    table = pq.read_table(log, columns=["tick"])
    metadata = json.loads(table.schema.metadata[b"motorctl"])
    lost, skipped = metadata["rows_lost"], metadata["loop"]["skipped_periods"]
    ticks = table["tick"].to_numpy()
    assert lost == seen[1]["rows_lost"]
    assert 0 < lost <= ticks[-1] - ticks[0] + 1 - len(ticks) <= lost + skipped
    assert "the disk took" in ended
    assert f"{lost} rows were lost" in ended
    (remark,) = LastRun(machine, run_file(machine.name)).begin()
    assert f"{lost} rows were lost" in remark


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_a_run_whose_log_cannot_be_finished_says_besides_how_many_rows_were_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    def play(recorded: Callable[[], Status]) -> None:
        for call in ("write", "ftruncate"):
            monkeypatch.setattr(f"motorctl.log.writer.os.{call}", refused)
        monkeypatch.setattr("motorctl.log.writer.convert", refused)
        wait_until(lambda: recorded()["rows_lost"] > 0)

    with monkeypatch.context() as patched:
        patched.setattr("motorctl.log.writer.os", SimpleNamespace(**vars(os)))  # the log's alone
        ended, _ = run_and_play(tmp_path, monkeypatch, play)
    assert "cannot be finished" in ended
    assert re.search(r"Input/output error; [1-9]\d* rows were lost", ended)
