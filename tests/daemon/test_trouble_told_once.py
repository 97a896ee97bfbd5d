"""A trouble that lasts is told once, and that it is over: no journal is filled with it."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import bench_config
from recorded_ring import AXES, Ring, ring, rotating, settings

from motorctl.config import load
from motorctl.daemon import spell
from motorctl.daemon.log_keeper import LogKeeper
from motorctl.daemon.recorder import Recorder
from motorctl.daemon.recording_watch import RecordingWatch
from motorctl.daemon.spell import Spell

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
MINUTES = {"max_duration_h": 1 / 60}


@pytest.fixture
def bench() -> Iterator[Ring]:
    with ring() as made:
        yield made


class Refusing:
    """Opens no new file while it has an errno."""

    def __init__(self) -> None:
        self.number: int | None = None
        self._open = os.open

    def __call__(self, path: Any, flags: int, *mode: int) -> int:
        if self.number is not None and flags & os.O_CREAT:
            raise OSError(self.number, os.strerror(self.number))
        return self._open(path, flags, *mode)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Refusing:
    refusing = Refusing()
    monkeypatch.setattr("motorctl.log.writer.os.open", refusing)
    return refusing


class Told:
    """A recording whose clock goes on by a second whenever a log is to be begun."""

    def __init__(self, bench: Ring, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(spell, "WELL_FOR_S", 0.0)
        (folder / "bench.yaml").write_text(bench_config())
        machine = load(str(folder / "bench.yaml"))
        assert list(machine.axes) == [axis.name for axis in AXES]
        self._seconds = 0
        self.log = rotating(folder, settings(rotate=MINUTES), lambda _: None, now=self._later)
        self.recorder = Recorder(bench.memory, self.log)
        self.keeper = LogKeeper(machine, folder)
        self.keeper.log = self.log
        self._watch = RecordingWatch(self.recorder, bench.memory, bench.rate_hz)
        self._bench = bench

    def _later(self) -> datetime:
        self._seconds += 1
        return NOON + timedelta(seconds=self._seconds)

    def goes_on(self, times: int = 1) -> None:
        for _ in range(times):
            self._bench.run(2000)
            self.recorder._take()
            self._watch.look()
            self.keeper.look()


def test_a_log_that_cannot_be_begun_is_told_once_and_again_when_it_can(
    bench: Ring,
    tmp_path: Path,
    disk: Refusing,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = Told(bench, tmp_path, monkeypatch)
    with caplog.at_level(logging.INFO, "motorctl"):
        told.goes_on(29)
        caplog.clear()
        disk.number = errno.ENOSPC
        told.goes_on(20)
        assert "so this one goes on" in str(told.log.trouble)
        (message,) = caplog.messages
        assert "the next log cannot be begun" in message
        assert "No space left on device" in message
        disk.number = errno.EDQUOT
        told.goes_on(20)
        assert len(caplog.messages) == 2
        assert os.strerror(errno.EDQUOT) in caplog.messages[1]
        disk.number = None
        told.goes_on(20)
    assert len(caplog.messages) == 3
    assert "logs are begun and ended again" in caplog.messages[-1]
    assert told.log.path.name in caplog.messages[-1]
    assert told.recorder.rows_lost == 0


def test_rows_that_no_file_can_be_made_for_are_told_once_and_how_many_when_it_is_over(
    bench: Ring,
    tmp_path: Path,
    disk: Refusing,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    disk.number = errno.ENOSPC
    told = Told(bench, tmp_path, monkeypatch)
    with caplog.at_level(logging.INFO, "motorctl"):
        told.goes_on(20)
        about_rows = [text for text in caplog.messages if text.startswith("recording")]
        assert len(about_rows) == 1
        assert "the recording cannot be opened: No space left on device" in about_rows[0]
        disk.number = None
        told.goes_on(3)
    about_rows = [text for text in caplog.messages if text.startswith("recording")]
    assert about_rows[1:] == ["recording resumed; 40000 rows were lost"]


def test_what_cannot_be_removed_is_told_once_though_it_is_tried_again_and_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = []

    def refused(*_: object) -> list[object]:
        tries.append(1)
        raise PermissionError(1, "Operation not permitted", f"bench-{len(tries)}.parquet")

    (tmp_path / "bench.yaml").write_text(bench_config())
    keeper = LogKeeper(load(str(tmp_path / "bench.yaml")), tmp_path)
    monkeypatch.setattr("motorctl.daemon.log_keeper.remove_outdated", refused)
    with caplog.at_level(logging.INFO, "motorctl"):
        for _ in range(10):
            keeper.look()
    assert len(tries) == 10
    assert len(caplog.messages) == 1


class Clock:
    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_a_trouble_that_comes_and_goes_within_seconds_is_one_spell() -> None:
    clock = Clock()
    trouble, told = Spell(10.0, clock), []
    for second in range(3600):
        clock.now_s = float(second)
        if trouble.is_news(text := "it fails" if second % 4 == 0 else None):
            told.append((second, text))
    assert told == [(0, "it fails")]
    clock.now_s += 11.0
    assert trouble.is_news(None)
    assert not trouble.is_news(None)
    assert trouble.is_news("it fails")


def test_what_comes_and_goes_all_day_is_told_a_few_times_an_hour() -> None:
    clock = Clock()
    trouble, told = Spell(10.0, clock), 0
    for second in range(86_400):
        clock.now_s = float(second)
        told += trouble.is_news("it fails" if second % 30 == 0 else None)
    assert told < 20
    clock.now_s += 3600.0
    assert trouble.is_news(None)
    clock.now_s += 3600.0
    assert trouble.is_news("it fails")
    clock.now_s += 11.0
    assert trouble.is_news(None)


def test_other_words_are_another_cause_and_other_numbers_are_not() -> None:
    trouble = Spell()
    assert trouble.is_news("499 MB are free")
    assert not trouble.is_news("501 MB are free")
    assert trouble.is_news("Read-only file system")
    assert not trouble.is_news("498.5 MB are free")
