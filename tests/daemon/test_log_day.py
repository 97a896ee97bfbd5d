"""A long recording on a small disk: nothing is lost but what retention says."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from daemon_rig import bench_config
from recorded_ring import AXES, MACHINE, metadata_of, rotating

from motorctl.config import load
from motorctl.daemon.log_keeper import LogKeeper
from motorctl.log import read_recording
from motorctl.log.folder import stored_logs
from motorctl.log.sample import TICK_SAMPLE, AxisState, axis_sample

CHUNK = 4096
NOISY = (
    "position_m",
    "velocity_m_s",
    "following_error_m",
    "command_v",
    "virtual_command_v",
    "d0_hat_v",
)


def size_of(path: Path) -> int:
    """Return the bytes of a file, none where the process beside has just removed it."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def recorded_on_a_disk(
    folder: Path,
    *,
    disk_mb: float,
    log_mb: float,
    rows: int,
    rate_hz: float,
    convert: Callable[[LogKeeper], None],
) -> tuple[LogKeeper, float]:
    """Record so many rows as fast as they can be written; give the keeper, and the fullest disk."""
    config = folder / "bench.yaml"
    kept_mb, stop_mb = 0.2 * disk_mb, 0.05 * disk_mb
    config.write_text(
        f"{bench_config()}recording: {{rotate: {{max_size_mb: {log_mb}, max_duration_h: null}}, "
        f"retention: {{min_free_mb: {kept_mb}}}, disk: {{stop_below_mb: {stop_mb}}}}}\n"
    )
    logs = folder / "logs"
    logs.mkdir()
    fullest = 0.0

    def free(_: Path) -> float:
        nonlocal fullest
        used = sum(size_of(path) for path in logs.iterdir())
        fullest = max(fullest, used)
        return disk_mb * 1e6 - used

    machine = load(str(config))
    keeper = LogKeeper(machine, logs, free)
    log = keeper.log = rotating(logs, machine.recording, keeper.take, free)
    random = np.random.default_rng(1)
    ticks = np.zeros(CHUNK, TICK_SAMPLE)
    samples = np.zeros((CHUNK, len(AXES)), axis_sample(2))
    samples["state"] = AxisState.RUNNING
    for first in range(0, rows, CHUNK):
        ticks["tick"] = np.arange(first, first + CHUNK)
        ticks["time_s"] = ticks["tick"] / rate_hz
        for name in NOISY:
            samples[name] = random.random((CHUNK, len(AXES)))
        samples["reference_m"] = ticks["tick"][:, None]
        log.append(ticks, samples)
        keeper.look()
        convert(keeper)
    log.close({"rows_lost": log.rows_lost})
    assert keeper.finish() == []
    return keeper, fullest


def assert_nothing_is_lost_but_what_retention_says(
    folder: Path, keeper: LogKeeper, rows: int
) -> None:
    log = keeper.log
    assert log is not None
    assert (log.rows, log.rows_lost, log.trouble) == (rows, 0, None)
    assert keeper.conversion.failed == []
    assert keeper.failure is None
    paths = [stored.path for stored in stored_logs(folder / "logs", MACHINE)]
    assert {path.name for path in (folder / "logs").iterdir()} == {path.name for path in paths}
    told = [metadata_of(path) for path in paths]
    # Every log of the run is there or was removed, and those that were removed are the first.
    assert [each["part"] for each in told] == list(range(keeper.removed + 1, log.part + 1))
    assert keeper.last_removed is not None
    assert told[0]["predecessor"] == keeper.last_removed.path.name
    following = None
    for path, each in zip(paths, told, strict=True):
        table = pq.read_table(path, columns=["tick", "x.reference_m", "y.reference_m"])
        tick = table["tick"].to_numpy()
        assert (np.diff(tick) == 1).all()
        assert (table["x.reference_m"].to_numpy() == tick).all()
        assert following in (None, tick[0])
        assert each["rows_lost"] == 0
        assert "recovered" not in each
        following = tick[-1] + 1
    assert following == rows


def _here(keeper: LogKeeper) -> None:
    """Make logs in this process: quick where they are small."""
    assert keeper.conversion.finish() == []


def _beside(keeper: LogKeeper) -> None:
    """Let the process of idle priority follow; a day has time for that, this test has not."""
    while len(keeper.conversion.waiting) > 2:
        keeper.look()
        time.sleep(0.01)


def test_a_recording_larger_than_its_disk_loses_nothing_but_what_retention_says(
    tmp_path: Path,
) -> None:
    rows = 80 * CHUNK
    keeper, fullest = recorded_on_a_disk(
        tmp_path, disk_mb=30, log_mb=9, rows=rows, rate_hz=400, convert=_here
    )
    assert_nothing_is_lost_but_what_retention_says(tmp_path, keeper, rows)
    assert keeper.removed >= 3
    assert fullest < 28.5e6  # recording would have stopped there


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.wall_clock  # at idle priority nothing gets done while other tests run
@pytest.mark.timeout(1800)
def test_a_day_of_two_axes_on_a_disk_of_2_gb(tmp_path: Path) -> None:
    """At 300 Hz, 26 million rows, as fast as the disk takes them."""
    rate_hz = 300
    rows = -(-86_400 * rate_hz // CHUNK) * CHUNK
    keeper, fullest = recorded_on_a_disk(
        tmp_path, disk_mb=2000, log_mb=150, rows=rows, rate_hz=rate_hz, convert=_beside
    )
    assert_nothing_is_lost_but_what_retention_says(tmp_path, keeper, rows)
    assert keeper.removed > 3
    assert fullest < 1900e6
    newest = stored_logs(tmp_path / "logs", MACHINE)[-2].path
    assert read_recording(newest).sample_rate_hz == rate_hz
