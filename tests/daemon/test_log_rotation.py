"""A run as a row of logs: every row in one of them, and each an ordinary log."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import settings as trying
from hypothesis import strategies as st
from recorded_ring import (
    AXES,
    MACHINE,
    MUCH,
    ROW_BYTES,
    Ring,
    being_recorded,
    finished,
    metadata_of,
    ring,
    rotating,
    settings,
    ticks_of,
)

from motorctl.daemon.recorder import Recorder
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.log import read_recording, recover
from motorctl.log.folder import stored_logs

MEGABYTE = 1_000_000


@pytest.fixture
def bench() -> Iterator[Ring]:
    with ring() as made:
        yield made


@trying(max_examples=12)
@given(
    chunks=st.lists(st.integers(1, 3000), min_size=1, max_size=12),
    rate_hz=st.sampled_from([3.0, 7.0, 1000.0]),
    minutes=st.one_of(st.none(), st.floats(1, 12)),
    size_mb=st.one_of(st.none(), st.floats(1, 3)),
)
def test_no_row_is_lost_or_doubled_wherever_logs_are_cut(
    chunks: list[int], rate_hz: float, minutes: float | None, size_mb: float | None
) -> None:
    rotate = {"max_duration_h": None if minutes is None else minutes / 60, "max_size_mb": size_mb}
    with ring(rate_hz) as bench, tempfile.TemporaryDirectory() as folder:
        sealed: list[Path] = []
        log = rotating(Path(folder), settings(rotate=rotate), sealed.append)
        for chunk in chunks:
            bench.run(chunk)
            log.append(*bench.take())
        logs = [*finished(sealed), log.close({"rows_lost": 0})]
        assert ticks_of(logs).tolist() == list(range(sum(chunks)))
        for path in logs[:-1]:
            times = pq.read_table(path)["time_s"].to_numpy()
            assert len(times) > 0
            if minutes is not None:
                # given in hours: a row may stand on the very end of them, as it is rounded
                assert times[-1] - times[0] < minutes * 60 + 1e-6
        if size_mb is not None and minutes is None:
            recorded = [len(pq.read_table(path)) * ROW_BYTES / MEGABYTE for path in logs]
            assert max(recorded) <= size_mb


def test_the_partial_file_keeps_below_the_size_that_was_asked_for(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate={"max_size_mb": 1}), sealed.append)
    for _ in range(20):
        bench.run(1000)
        log.append(*bench.take())
    sizes = [path.stat().st_size for path in sealed]
    assert len(sizes) >= 3
    assert all(0.9 * MEGABYTE < size <= 1.02 * MEGABYTE for size in sizes)
    log.close({})


def test_every_log_says_which_part_of_which_run_it_is(bench: Ring, tmp_path: Path) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate={"max_duration_h": 1 / 60}), sealed.append)
    for _ in range(26):
        bench.run(5000)
        log.append(*bench.take())
    logs = [*finished(sealed), log.close({"rows_lost": 0})]
    told = [metadata_of(path) for path in logs]
    assert [each["part"] for each in told] == [1, 2, 3]
    assert {each["run"] for each in told} == {logs[0].stem}
    assert [each["predecessor"] for each in told] == [None, logs[0].name, logs[1].name]
    assert [each["successor"] for each in told] == [logs[1].name, logs[2].name, None]
    assert [each["rows"] for each in told] == [60_000, 60_000, 10_000]
    assert all("recovered" not in each and each["rows_lost"] == 0 for each in told)
    for path in logs:
        assert len(read_recording(path).time_s) == metadata_of(path)["rows"]


def test_the_first_log_of_other_models_names_the_one_before_and_no_later_one_does(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate={"max_duration_h": 1 / 60}), sealed.append)
    for run in range(3):
        if run == 1:
            log.change_models(AXES, dict)
        for _ in range(13):
            bench.run(5000)
            log.append(*bench.take())
    logs = [*finished(sealed), log.close({"rows_lost": 0})]
    told = [metadata_of(path) for path in logs]
    assert [each["part"] for each in told] == [1, 2, 1, 2, 3]
    before = [each["other_models_before"] for each in told]
    assert before == [None, None, logs[1].name, None, None]


def test_the_logs_of_a_run_are_found_in_the_order_of_their_rows(
    bench: Ring, tmp_path: Path
) -> None:
    """Though a dozen of them may begin within one second."""
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate={"max_size_mb": 1}), sealed.append)
    for _ in range(12):
        bench.run(4500)
        log.append(*bench.take())
    finished(sealed)
    log.close({})
    ticks = ticks_of([stored.path for stored in stored_logs(tmp_path, MACHINE)])
    assert (np.diff(ticks) == 1).all()


def test_what_was_lost_is_told_by_the_log_in_which_it_is_missing(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    lost = [0]
    keys = settings(rotate={"max_duration_h": 1 / 60})
    log = rotating(tmp_path, keys, sealed.append, lost=lambda: lost[0])
    for number in range(25):
        if number == 3:
            lost[0] = 7  # the ring was overwritten
        bench.run(5000)
        log.append(*bench.take())
    logs = [*finished(sealed), log.close({"rows_lost": lost[0]})]
    assert [metadata_of(path)["rows_lost"] for path in logs] == [7, 0, 0]


@pytest.mark.slow
def test_rows_are_on_disk_while_the_recording_goes_on_in_the_next_log(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate={"max_size_mb": 1}), sealed.append)
    recording = Recorder(bench.memory, log)
    recording.start()
    while len(sealed) < 2:
        bench.run(1000)
        time.sleep(0.3)
    rows = recording.rows_written
    copy = tmp_path / "copy.parquet.partial"
    copy.write_bytes(being_recorded(log).read_bytes())
    kept = [*finished(sealed), recover(copy).path]
    assert ticks_of(kept).tolist()[:rows] == list(range(rows))
    recording.finish(dict)


def test_a_next_log_that_cannot_be_begun_is_told_and_this_one_goes_on(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(rotate={"max_size_mb": 1}), sealed.append)

    def refused(*_: object) -> Path:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    with monkeypatch.context() as patch:
        patch.setattr("motorctl.daemon.rotating_log.free_log_path", refused)
        for _ in range(3):
            bench.run(4000)
            log.append(*bench.take())
        assert "next log cannot be begun" in str(log.trouble)
    bench.run(2000)
    log.append(*bench.take())
    assert log.trouble is None
    logs = [*finished(sealed), log.close({})]
    assert len(logs) == 2
    assert ticks_of(logs).tolist() == list(range(14_000))


def test_recording_stops_before_the_disk_is_full_and_goes_on_in_a_new_log(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    free = [MUCH]
    keys = settings(disk={"stop_below_mb": 100})
    log = rotating(tmp_path, keys, sealed.append, free=lambda _: free[0])
    bench.run(1000)
    log.append(*bench.take())
    free[0] = 99e6
    for _ in range(3):
        bench.run(1000)
        with pytest.raises(RunError, match=r"99 MB are free.*stop_below_mb.*in a new log"):
            log.append(*bench.take())
    assert (log.rows, log.rows_lost) == (1000, 3000)
    free[0] = 105e6  # more than the limit, but it would be there again at once
    bench.run(1000)
    with pytest.raises(RunError, match="105 MB are free, recording needs 110"):
        log.append(*bench.take())
    free[0] = 120e6
    bench.run(1000)
    log.append(*bench.take())
    logs = [*finished(sealed), log.close({"rows_lost": 4000})]
    assert ticks_of(logs).tolist() == [*range(1000), *range(5000, 6000)]
    assert metadata_of(logs[1])["predecessor"] == logs[0].name
    assert metadata_of(logs[0])["successor"] is None
    assert metadata_of(logs[1])["rows_lost"] == 4000
    assert len(list(tmp_path.iterdir())) == 2


@trying(max_examples=12)
@given(
    steps=st.lists(st.tuples(st.integers(1, 2500), st.booleans()), min_size=2, max_size=12),
    size_mb=st.one_of(st.none(), st.just(1.0)),
)
def test_whenever_the_disk_is_full_every_row_is_in_one_log_or_counted_as_lost(
    steps: list[tuple[int, bool]], size_mb: float | None
) -> None:
    free = [MUCH]
    keys = settings(disk={"stop_below_mb": 100}, rotate={"max_size_mb": size_mb})
    with ring() as bench, tempfile.TemporaryDirectory() as folder:
        sealed: list[Path] = []
        log = rotating(Path(folder), keys, sealed.append, lambda _: free[0], lambda: log.rows_lost)
        expected: list[int] = []
        for rows, full in steps:
            free[0] = 99e6 if full else MUCH
            first = bench.rows
            bench.run(rows)
            try:
                log.append(*bench.take())
                expected += range(first, first + rows)
            except RunError:
                assert full
        lost = bench.rows - len(expected)
        assert (log.rows, log.rows_lost) == (len(expected), lost)
        ended_at = log.part
        log.close({"rows_lost": lost})
        finished(sealed)
        logs = [stored.path for stored in stored_logs(Path(folder), MACHINE)]
        told = [metadata_of(path) for path in logs]
        assert [each["part"] for each in told] == list(range(1, len(logs) + 1))
        assert ended_at == len(logs)
        if logs:
            assert ticks_of(logs).tolist() == expected
            # What is lost after the last log has no log that could tell it: `status` does.
            assert sum(each["rows_lost"] for each in told) <= lost


def test_a_disk_that_is_nearly_full_from_the_start_leaves_no_empty_logs(
    bench: Ring, tmp_path: Path
) -> None:
    free = [50e6]
    keys = settings(disk={"stop_below_mb": 100})
    log = rotating(tmp_path, keys, lambda _: None, free=lambda _: free[0])
    for _ in range(3):
        bench.run(100)
        with pytest.raises(RunError, match="50 MB are free"):
            log.append(*bench.take())
    assert list(tmp_path.iterdir()) == []
    free[0] = MUCH
    bench.run(100)
    log.append(*bench.take())
    path = log.close({"rows_lost": 300})
    told = metadata_of(path)
    assert (told["run"], told["part"], told["predecessor"]) == (path.stem, 1, None)
    assert ticks_of([path]).tolist() == list(range(300, 400))


def test_a_disk_that_is_full_when_the_daemon_starts_does_not_stop_it(
    bench: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("motorctl.log.writer.os.write", full)
        log = rotating(tmp_path, settings(), lambda _: None)
        bench.run(100)
        with pytest.raises(MotorctlError, match="No space left"):
            log.append(*bench.take())
    assert (log.rows_lost, list(tmp_path.iterdir())) == (100, [])
    bench.run(100)
    log.append(*bench.take())
    path = log.close({"rows_lost": 100})
    assert ticks_of([path]).tolist() == list(range(100, 200))
    assert metadata_of(path)["part"] == 1


def test_a_folder_that_cannot_be_written_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="the recording cannot be opened"):
        rotating(tmp_path / "file", settings(), lambda _: None)


def test_a_file_that_may_not_grow_costs_no_row(bench: Ring, tmp_path: Path) -> None:
    """As on file systems whose files are at most 4 GB."""
    resource = pytest.importorskip("resource")
    sealed: list[Path] = []
    log = rotating(tmp_path, settings(disk={"stop_below_mb": 0}), sealed.append)
    bench.run(2000)
    log.append(*bench.take())
    written = being_recorded(log).stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (written + 50_000, hard))
    try:
        bench.run(1000)
        log.append(*bench.take())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert log.rows_lost == 0
    logs = [*finished(sealed), log.close({})]
    assert len(logs) == 2
    assert ticks_of(logs).tolist() == list(range(3000))


_ON_A_SMALL_DISK = """
import sys, time
from pathlib import Path
from recorded_ring import ring, rotating, settings, finished, ticks_of
from motorctl.errors import RunError
from motorctl.log.folder import stored_logs
folder = Path(sys.argv[1])
with ring() as bench:
    sealed = []
    log = rotating(folder, settings(disk={"stop_below_mb": 0}), sealed.append,
                   free=lambda _: 1e15)  # nobody warns: the disk itself refuses
    refused = 0
    while refused < 3:
        bench.run(2000)
        try:
            log.append(*bench.take())
        except RunError as error:
            assert "No space left" in str(error), error
            refused += 1
    lost = log.rows_lost
    assert lost == 3 * 2000, lost
    first = bench.rows - lost
    (folder / "ballast").unlink()
    bench.run(2000)
    log.append(*bench.take())
    assert log.rows_lost == lost
    logs = [*finished(sealed), log.close({})]
    assert ticks_of(logs).tolist() == [*range(first), *range(first + lost, first + lost + 2000)]
    assert len(stored_logs(folder, "bench")) == len(logs) == 2, logs
print("kept")
"""


@pytest.mark.slow
def test_a_disk_that_is_really_full_costs_only_the_rows_that_it_refused(tmp_path: Path) -> None:
    """On a file system of 8 MB, in a name space of its own."""
    script = (
        'mount -t tmpfs -o size=8m tmpfs "$1" && head -c 4000000 /dev/zero > "$1/ballast" && '
        'exec "$2" -c "$3" "$1"'
    )
    command = ["unshare", "-rm", "sh", "-c", script, "sh"]
    try:
        probe = subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False)
    except FileNotFoundError:
        pytest.skip("no unshare")
    if probe.returncode:
        pytest.skip("this machine gives no name spaces")
    done = subprocess.run(
        [*command, str(tmp_path), sys.executable, _ON_A_SMALL_DISK],
        cwd=Path(__file__).parents[1] / "support",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "kept\n", done.stderr
