"""A disk that becomes slow, read-only or gone under a recording: every row is accounted for."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from recorded_ring import (
    MACHINE,
    Ring,
    being_recorded,
    finished,
    ring,
    rotating,
    settings,
    ticks_of,
)

from motorctl.daemon.recorder import Recorder
from motorctl.daemon.rotating_log import RotatingLog
from motorctl.errors import RunError
from motorctl.log import recover
from motorctl.log.folder import stored_logs


@pytest.fixture
def bench() -> Iterator[Ring]:
    with ring() as made:
        yield made


def record(bench: Ring, log: RotatingLog, rows: int) -> None:
    bench.run(rows)
    log.append(*bench.take())


class Refusing:
    """A system call on files that refuses with an error of the disk, of all or of one file."""

    def __init__(self, number: int, only: int | None = None, call: Any = os.write) -> None:
        self._number, self._only, self._call = number, only, call

    def __call__(self, file: int, argument: Any) -> Any:
        if self._only is None or os.fstat(file).st_ino == self._only:
            raise OSError(self._number, os.strerror(self._number))
        return self._call(file, argument)


@pytest.mark.parametrize("number", [errno.EROFS, errno.EIO, errno.ESTALE])
def test_a_disk_that_refuses_everything_costs_the_rows_until_it_takes_them_again(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    log = rotating(tmp_path, settings(), lambda _: None)
    record(bench, log, 1000)
    with monkeypatch.context() as patch:
        patch.setattr("motorctl.log.writer.os.write", Refusing(number))
        for _ in range(3):
            with pytest.raises(RunError, match=os.strerror(number)):
                record(bench, log, 1000)
    assert (log.rows, log.rows_lost, log.trouble) == (1000, 3000, None)
    record(bench, log, 1000)
    assert ticks_of([log.close({"rows_lost": 3000})]).tolist() == [
        *range(1000),
        *range(4000, 5000),
    ]
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("can_be_cut", [True, False])
def test_a_file_that_its_disk_no_longer_takes_is_left_for_a_new_one_and_no_row_is_lost(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, can_be_cut: bool
) -> None:
    """As after a disk was pulled and mounted anew: the open file stays dead for ever."""
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(), sealed.append)
    record(bench, log, 1000)
    dead = being_recorded(log).stat().st_ino
    monkeypatch.setattr("motorctl.log.writer.os.write", Refusing(errno.EIO, dead))
    if not can_be_cut:
        cut = Refusing(errno.EIO, dead, os.ftruncate)
        monkeypatch.setattr("motorctl.log.writer.os.ftruncate", cut)
    record(bench, log, 1000)
    assert (log.rows, log.rows_lost, log.part) == (2000, 0, 2)
    assert "could not be told its end" in str(log.trouble)
    logs = [*finished(sealed), log.close({})]
    assert ticks_of(logs).tolist() == list(range(2000))


def test_what_a_failing_disk_wrote_of_a_batch_is_cut_off_before_the_next_one(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = rotating(tmp_path, settings(), lambda _: None)
    record(bench, log, 1000)
    whole = os.write

    def half(file: int, data: bytes) -> int:
        monkeypatch.setattr("motorctl.log.writer.os.write", Refusing(errno.EIO))
        return whole(file, data[: len(data) // 2])

    with monkeypatch.context() as patch:
        patch.setattr("motorctl.log.writer.os.ftruncate", Refusing(errno.EIO))
        monkeypatch.setattr("motorctl.log.writer.os.write", half)
        monkeypatch.setattr(log, "_rotated", lambda: False)
        with pytest.raises(RunError, match="Input/output error"):
            record(bench, log, 1000)
    monkeypatch.undo()
    record(bench, log, 1000)
    assert ticks_of([log.close({"rows_lost": 1000})]).tolist() == [
        *range(1000),
        *range(2000, 3000),
    ]


def test_a_folder_that_is_removed_costs_what_was_in_it_and_is_told(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    log = rotating(folder, settings(), lambda _: None)
    record(bench, log, 1000)
    shutil.rmtree(folder)
    with caplog.at_level(logging.ERROR, "motorctl"):
        record(bench, log, 1000)
        record(bench, log, 1000)
    (told,) = caplog.messages
    assert "was removed while it was recorded, and its 1000 rows with it" in told
    assert (log.rows, log.rows_lost) == (2000, 1000)
    path = log.close({"rows_lost": 1000})
    assert ticks_of([path]).tolist() == list(range(1000, 3000))
    assert [stored.path for stored in stored_logs(folder, MACHINE)] == [path]


def test_a_file_that_is_moved_keeps_its_rows_and_a_new_log_is_begun(
    bench: Ring, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = rotating(tmp_path, settings(), lambda _: None)
    record(bench, log, 1000)
    moved = tmp_path / "mine.parquet.partial"
    being_recorded(log).rename(moved)
    record(bench, log, 1000)
    assert "was moved while it was recorded" in caplog.text
    assert (log.rows, log.rows_lost) == (2000, 0)
    assert ticks_of([recover(moved).path]).tolist() == list(range(1000))
    assert ticks_of([log.close({})]).tolist() == list(range(1000, 2000))


def test_the_recorder_counts_what_was_removed_as_lost(bench: Ring, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    recorder = Recorder(bench.memory, rotating(folder, settings(), lambda _: None))
    bench.run(500)
    recorder._drain()
    shutil.rmtree(folder)
    bench.run(700)
    recorder._drain()
    assert (recorder.rows_written, recorder.rows_lost) == (700, 500)
    assert ticks_of([recorder.finish(dict)]).tolist() == list(range(500, 1200))


@pytest.mark.slow
def test_a_disk_that_takes_seconds_for_each_write_costs_no_row_while_the_ring_holds_them(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[float] = []

    def slow(file: int, sync=os.fdatasync) -> None:
        begun.append(time.monotonic())
        time.sleep(0.4)
        sync(file)

    recorder = Recorder(bench.memory, rotating(tmp_path, settings(), lambda _: None))
    monkeypatch.setattr("motorctl.log.writer.os.fdatasync", slow)
    recorder.start()
    share = bench.memory.ring_rows // 8
    for _ in range(6):  # the ring is three quarters full before the disk has taken twice
        bench.run(share)
        time.sleep(0.05)
    assert len(begun) <= 2
    path = recorder.finish(dict)
    assert (recorder.rows_lost, recorder.failure) == (0, None)
    assert ticks_of([path]).tolist() == list(range(6 * share))
