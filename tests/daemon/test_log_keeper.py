"""Closed logs are made smaller and removed beside the recording; the disk is watched."""

from __future__ import annotations

import contextlib
import logging
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from daemon_rig import bench_config, wait_until
from recorded_ring import MUCH, Ring, finished, metadata_of, ring, rotating, settings, ticks_of

from motorctl.config import load
from motorctl.config.machine import Machine
from motorctl.config.recording_rules import RecordingRate
from motorctl.daemon import log_keeper
from motorctl.daemon.conversion import Conversion
from motorctl.daemon.disk_outlook import DiskOutlook, Occupied, files_left
from motorctl.daemon.log_keeper import LogKeeper
from motorctl.daemon.rotating_log import RotatingLog
from motorctl.log.folder import stored_logs

pytestmark = pytest.mark.slow

SUPPORT = Path(__file__).parents[1] / "support"
MINUTES = {"max_duration_h": 1 / 60}


@pytest.fixture
def bench() -> Iterator[Ring]:
    with ring() as made:
        yield made


def machine(folder: Path, recording: str = "{}") -> Machine:
    path = folder / "bench.yaml"
    path.write_text(bench_config() + f"recording: {recording}\n")
    return load(str(path))


def recorded(bench: Ring, log: RotatingLog, minutes: float) -> None:
    for _ in range(round(minutes * 12)):
        bench.run(5000)
        log.append(*bench.take())


def done(conversion: Conversion) -> bool:
    conversion.look()
    return conversion.current is None and not conversion.waiting


def test_closed_logs_are_made_one_at_a_time_at_idle_priority_off_the_cpus_of_the_loop(
    bench: Ring, tmp_path: Path
) -> None:
    conversion = Conversion()
    cpus = os.sched_getaffinity(0)
    conversion.keep_off = frozenset({max(cpus)})
    others = frozenset(cpus - conversion.keep_off or cpus)  # a process with one CPU has no other
    log = rotating(tmp_path, settings(rotate=MINUTES), conversion.add)
    recorded(bench, log, 2.5)
    conversion.look()
    process = conversion._process
    assert process is not None
    policies, nices, places = set(), set(), set()

    def watched() -> bool:
        try:
            for thread in Path(f"/proc/{process.pid}/task").iterdir():
                places.add(frozenset(os.sched_getaffinity(int(thread.name))))
            policies.add(os.sched_getscheduler(process.pid))
            nices.add(os.getpriority(os.PRIO_PROCESS, process.pid))
        except OSError:
            pass
        assert len(list(tmp_path.glob("*.tmp"))) <= 1
        return done(conversion)

    wait_until(watched)
    assert os.SCHED_IDLE in policies
    assert 19 in nices
    assert others in places
    assert places <= {frozenset(cpus), others}
    assert conversion.failure is None
    log.close({})
    logs = [stored.path for stored in stored_logs(tmp_path, "bench")]
    assert ticks_of(logs).tolist() == list(range(150_000))
    assert not list(tmp_path.glob("*.partial"))
    assert 0 < conversion.closed_bytes < conversion.recorded_bytes


def test_a_log_says_the_same_whether_it_is_made_in_the_background_or_recovered(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate=MINUTES), sealed.append)
    recorded(bench, log, 1.5)
    copy = tmp_path / "copy.parquet.partial"
    copy.write_bytes(sealed[0].read_bytes())
    conversion = Conversion()
    conversion.add(sealed[0])
    wait_until(lambda: done(conversion))
    (recovered,) = finished([copy])
    made = sealed[0].with_suffix("")
    assert made.read_bytes() == recovered.read_bytes()
    assert metadata_of(made)["successor"] == log.path.name
    log.close({})


def test_a_process_that_is_killed_while_it_makes_a_log_costs_nothing(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    conversion = Conversion()
    log = rotating(tmp_path, settings(rotate=MINUTES), conversion.add)
    recorded(bench, log, 1.5)
    conversion.look()
    assert conversion._process is not None
    os.kill(conversion._process.pid, signal.SIGKILL)
    wait_until(lambda: done(conversion))
    assert "ended with status -9" in str(conversion.failure)
    log.close({})
    # The next start finds it and finishes it.
    keeper = LogKeeper(machine(tmp_path), tmp_path)
    with caplog.at_level(logging.INFO, "motorctl"):
        keeper.begin()
        assert "1 of earlier runs are unfinished" in caplog.text
        assert keeper.finish() == []
    logs = [stored.path for stored in stored_logs(tmp_path, "bench")]
    assert ticks_of(logs).tolist() == list(range(90_000))
    assert "recovered" not in metadata_of(logs[0])


def with_its_maker_stopped(bench: Ring, folder: Path) -> tuple[RotatingLog, Conversion, int]:
    """Record until a log is made of what is closed, and have the process that makes it stand."""
    conversion = Conversion()
    log = rotating(folder, settings(rotate=MINUTES), conversion.add)
    recorded(bench, log, 1.5)
    conversion.look()
    assert conversion._process is not None
    pid = conversion._process.pid
    os.kill(pid, signal.SIGSTOP)
    return log, conversion, pid


def test_a_process_that_stands_still_while_it_makes_a_log_holds_up_neither_rows_nor_the_end(
    bench: Ring, tmp_path: Path
) -> None:
    log, conversion, _ = with_its_maker_stopped(bench, tmp_path)
    recorded(bench, log, 1.5)
    conversion.look()
    assert conversion.current is not None
    assert len(conversion.waiting) == 1
    log.close({})
    assert conversion.finish() == []  # it is killed, and its work done here
    logs = [stored.path for stored in stored_logs(tmp_path, "bench")]
    assert ticks_of(logs).tolist() == list(range(180_000))
    assert not list(tmp_path.glob("*.partial")) + list(tmp_path.glob("*.tmp"))


def test_a_process_that_stood_still_and_goes_on_makes_its_log_all_the_same(
    bench: Ring, tmp_path: Path
) -> None:
    log, conversion, pid = with_its_maker_stopped(bench, tmp_path)
    recorded(bench, log, 0.1)
    os.kill(pid, signal.SIGCONT)
    wait_until(lambda: done(conversion))
    assert conversion.failure is None
    log.close({})
    logs = [stored.path for stored in stored_logs(tmp_path, "bench")]
    assert ticks_of(logs).tolist() == list(range(95_000))


def test_a_daemon_that_stops_finishes_what_was_begun(bench: Ring, tmp_path: Path) -> None:
    conversion = Conversion()
    log = rotating(tmp_path, settings(rotate=MINUTES), conversion.add)
    recorded(bench, log, 2.5)
    conversion.look()
    log.close({})
    assert conversion.finish() == []
    assert not list(tmp_path.glob("*.partial"))
    assert not list(tmp_path.glob("*.tmp"))
    logs = [stored.path for stored in stored_logs(tmp_path, "bench")]
    assert ticks_of(logs).tolist() == list(range(150_000))


def test_a_damaged_recording_is_told_and_the_next_is_made_a_log(
    bench: Ring, tmp_path: Path
) -> None:
    broken = tmp_path / "bench-20260101T000000Z.parquet.partial"
    broken.write_bytes(b"no recording")
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate=MINUTES), sealed.append)
    recorded(bench, log, 1.5)
    conversion = Conversion()
    assert conversion.add_leftovers(tmp_path, "bench") == [broken, sealed[0]]
    wait_until(lambda: done(conversion))
    assert conversion.failed == [broken]
    assert conversion.finish() == []  # no failure of this run
    assert conversion.failed == [broken]
    assert broken.read_bytes() == b"no recording"
    assert sealed[0].with_suffix("").exists()
    log.close({})


def test_what_could_not_be_made_a_log_is_tried_again(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate=MINUTES), sealed.append)
    recorded(bench, log, 1.2)
    log.close({})
    in_the_way = sealed[0].with_suffix("")
    in_the_way.write_bytes(b"another file")
    conversion = Conversion()
    conversion.add(sealed[0])
    wait_until(lambda: done(conversion))
    assert "another file is here" in str(conversion.failure)
    in_the_way.unlink()
    conversion.look()
    assert conversion.current is None  # not at once
    monkeypatch.setattr("motorctl.daemon.conversion.TRY_AGAIN_S", 0.0)
    conversion.look()
    wait_until(lambda: done(conversion))
    assert (conversion.failure, conversion.failed) == (None, [])
    assert ticks_of([in_the_way]).tolist() == list(range(60_000))


_RECORDS_UNTIL_IT_IS_KILLED = """
import sys
from pathlib import Path
from recorded_ring import ring, rotating, settings
from motorctl.daemon.conversion import Conversion
folder = Path(sys.argv[1])
conversion = Conversion()
with ring() as bench:
    log = rotating(folder, settings(rotate={"max_size_mb": 1}), conversion.add)
    while True:
        bench.run(400)
        log.append(*bench.take())
        print(bench.rows, "rows are on the disk", flush=True)
        conversion.look()
        if conversion._process is not None:
            print("made by", conversion._process.pid, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize("logs", [pytest.param(n, marks=pytest.mark.long) for n in (2, 3, 5)] + [4])
def test_a_recorder_that_is_killed_between_logs_loses_no_row(
    tmp_path: Path, logs: int, both: bool
) -> None:
    """Its process writes and rotates all the time, so the kill comes at any moment of that.

    With `both` the process that makes a log of a closed recording is killed at once with it.
    """
    process = subprocess.Popen(
        [sys.executable, "-c", _RECORDS_UNTIL_IT_IS_KILLED, str(tmp_path)],
        cwd=SUPPORT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    with process.stdout:
        makers: set[int] = set()
        while len(stored_logs(tmp_path, "bench")) <= logs or (both and not makers):
            line = process.stdout.readline()
            assert line
            makers = {int(line.split()[-1])} if line.startswith("made by") else set()
        process.kill()
        for maker in makers if both else ():
            with contextlib.suppress(ProcessLookupError):
                os.kill(maker, signal.SIGKILL)
        process.wait()
        rows = max(map(int, re.findall(r"^(\d+) rows", process.stdout.read(), re.M)), default=0)
    wait_until(lambda: not _converting(tmp_path))
    keeper = LogKeeper(machine(tmp_path), tmp_path)
    keeper.begin()
    assert keeper.finish() == []
    # One that the killed process began may have come first, with the last log but one.
    wait_until(lambda: not list(tmp_path.glob("*.partial")))
    found = [stored.path for stored in stored_logs(tmp_path, "bench")]
    ticks = ticks_of(found).tolist()
    assert ticks == list(range(len(ticks)))
    assert len(ticks) >= rows
    assert [metadata_of(path).get("recovered", False) for path in found[:-1]].count(True) <= 1


def _converting(folder: Path) -> bool:
    """Tell whether the process that the killed one left still makes a log."""
    from motorctl.log.folder import in_use

    return any(in_use(log) for log in stored_logs(folder, "bench"))


def test_old_logs_are_removed_while_recording_and_each_removal_is_told(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    keys = "{rotate: {max_size_mb: 20}, retention: {max_total_size_mb: 40}}"
    keeper = LogKeeper(machine(tmp_path, keys), tmp_path)
    old = tmp_path / "bench-20250101T000000Z.parquet"
    old.write_bytes(bytes(41_000_000))
    mine = tmp_path / "notes.txt"
    mine.write_text("mine")
    with caplog.at_level(logging.INFO, "motorctl"):
        keeper.begin()
    assert not old.exists()
    assert f"log {old} (41 MB) removed: all logs took more than 40 MB" in caplog.text
    told = keeper.status()["retention"]
    assert (told["removed"], told["last_removed"]) == (1, old.name)
    assert mine.exists()


def test_a_log_that_cannot_be_removed_is_told_and_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> list[object]:
        raise PermissionError(1, "Operation not permitted", "bench-1.parquet")

    keeper = LogKeeper(machine(tmp_path), tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("motorctl.daemon.log_keeper.remove_outdated", refused)
        keeper.look()
    assert "Operation not permitted" in str(keeper.failure)
    keeper.take(tmp_path / "none.partial")
    keeper.look()
    assert keeper.failure is None


def test_a_warning_tells_how_many_hours_are_left_once_until_half_of_them_are_gone(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motorctl.daemon.log_keeper.FORETELL_PERIOD_S", 0.0)
    free = [MUCH]
    here = machine(
        tmp_path, "{disk: {warn_below_h: 10, stop_below_mb: 0}, rotate: {max_size_mb: 20}}"
    )
    keeper = LogKeeper(here, tmp_path, lambda _: free[0])
    log = rotating(tmp_path, here.recording, keeper.take, keeper._free)
    keeper.log = log
    recorded(bench, log, 0.5)
    with caplog.at_level(logging.INFO, "motorctl"):
        keeper.look()
    assert "MB an hour are kept: enough for" in caplog.text
    caplog.clear()
    assert keeper.warning is None
    assert keeper.outlook is not None
    closed = keeper.outlook.closed_mb_h
    with caplog.at_level(logging.WARNING, "motorctl"):
        for hours in (9.0, 8.0, 7.0, 4.0):
            free[0] = hours * closed * 1e6 + 20e6
            keeper.look()
            assert keeper.warning is not None
    assert len(caplog.records) == 2
    assert "recording can go on for about" in caplog.records[0].message
    assert keeper.status()["disk"]["warning"] == keeper.warning
    free[0] = 0.5 * closed * 1e6 + 20e6
    keeper.look()
    # Half an hour, and what the open log gives back when it is closed.
    told = re.search(r"can go on for about ([\d.]+) min:", str(keeper.warning))
    assert told
    assert 30.0 <= float(told[1]) < 40.0
    log.close({})
    keeper.finish()


def test_a_disk_on_which_few_files_can_be_made_is_told_until_half_of_them_are_gone(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motorctl.daemon.log_keeper.FORETELL_PERIOD_S", 0.0)
    left = [100.0]
    here = machine(tmp_path)
    keeper = LogKeeper(here, tmp_path, lambda _: MUCH, lambda _: left[0])
    keeper.log = rotating(tmp_path, here.recording, keeper.take)
    with caplog.at_level(logging.WARNING, "motorctl"):
        keeper.look()
        assert (keeper.warning, caplog.messages) == (None, [])
        for left[0] in (90.0, 80.0, 60.0, 40.0, 30.0):
            keeper.look()
            assert f"only {left[0]:.0f} more files can be made" in str(keeper.warning)
        assert [text.split(" (")[0] for text in caplog.messages] == [
            "disk: only 90 more files can be made",
            "disk: only 40 more files can be made",
        ]
        told = keeper.status()["disk"]
        assert (told["free_files"], told["warning"]) == (30, keeper.warning)
        for left[0] in (5000.0, math.inf):
            keeper.look()
            assert keeper.warning is None
    assert keeper.status()["disk"]["free_files"] is None
    assert len(caplog.messages) == 2


@pytest.mark.parametrize(("files", "left"), [(0, math.inf), (1000, 7.0)])
def test_a_disk_that_counts_no_files_has_no_limit_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: int, left: float
) -> None:
    counted = SimpleNamespace(f_files=files, f_favail=7 if files else 0)
    monkeypatch.setattr("motorctl.daemon.disk_outlook.os.statvfs", lambda _: counted)
    assert files_left(tmp_path) == left


RATE = RecordingRate(row_bytes=328, rate_hz=5000.0)


def test_looking_again_removes_no_more_while_the_disk_has_not_freed_what_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for day in range(1, 7):
        (tmp_path / f"bench-2026010{day}T000000Z.parquet").write_bytes(bytes(1_000_000))
    free = [4e6]
    keeper = LogKeeper(
        machine(tmp_path, "{retention: {min_free_mb: 5.5}}"), tmp_path, lambda _: free[0]
    )
    for _ in range(3):
        keeper.look()
    assert keeper.removed == 2
    now_s = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now_s + log_keeper.FREED_AFTER_S)
    keeper.look()
    assert keeper.removed == 4  # it was not freed: somebody else has filled the disk
    free[0] = 5.6e6
    keeper.look()
    assert keeper.removed == 4


def outlook(free_mb: float, logs_mb: float = 0.0, **recording: object) -> float | None:
    rotate = {"max_size_mb": 2000, "max_duration_h": 1}
    keys = settings(**{"rotate": rotate, **recording})
    occupied = Occupied(free_mb, logs_mb, recorded_mb=0.0, closed_share=0.2)
    return DiskOutlook(keys, RATE, 500.0).look(0.0, 0, occupied).hours_left


def test_the_hours_left_are_those_of_closed_logs_but_the_last_one_is_large() -> None:
    an_hour = 328 * 5000 * 3600 / 1e6
    left = outlook(500 + 100 * 0.2 * an_hour)
    assert left == pytest.approx(100 - 0.8 * 2000 / (0.2 * an_hour))
    assert outlook(500) == 0.0
    assert outlook(500 + 100) == pytest.approx(100 / an_hour)


@pytest.mark.parametrize(
    ("retention", "kept_free"),
    [
        ({}, False),
        ({"min_free_mb": 1000}, True),
        ({"max_total_size_mb": 50_000}, True),
        ({"max_total_size_mb": 500_000}, False),
        ({"max_age_days": 1}, True),
        ({"max_age_days": 400}, False),
    ],
)
def test_where_retention_keeps_the_disk_free_no_end_is_foretold(
    retention: dict[str, float], kept_free: bool
) -> None:
    assert (outlook(100_000, retention=retention) is None) == kept_free


def test_a_recording_that_pauses_takes_no_space() -> None:
    keys = settings(rotate=MINUTES)
    disk = DiskOutlook(keys, RATE, 500.0)
    occupied = Occupied(10_000, 0.0, 0.0, None)
    disk.look(0.0, 1000, occupied)
    assert disk.look(3600.0, 1000, occupied).hours_left is None
