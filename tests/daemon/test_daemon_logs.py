"""Logs of a running daemon: rotated, made smaller, removed; the loop goes on."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from daemon_rig import Daemon, alive, bench_config, wait_until
from recorded_ring import metadata_of, ticks_of

from motorctl.log.folder import in_use, stored_logs
from motorctl.log.sample import AxisState

pytestmark = pytest.mark.wall_clock(lanes=3)

ROTATING = "recording: {rotate: {max_duration_h: 0.016667}}\n"
PAUSING = "recording: {while_off: pause}\n"


def logs_of(daemon: Daemon) -> list[Path]:
    return [stored.path for stored in stored_logs(daemon.logs, "bench")]


@pytest.mark.slow
def test_rows_are_left_out_while_every_axis_is_off(tmp_path: Path) -> None:
    with Daemon(tmp_path, bench_config() + PAUSING) as daemon:
        wait_until(lambda: daemon.ask("status")["recording"]["paused"])
        rows = daemon.ask("status")["recording"]["rows"]
        assert "paused: every axis is off" in daemon.cli("status").stdout
        wait_until(lambda: daemon.ask("status")["loop"]["ticks"] > rows + 300)
        daemon.ask("start", axis="x")
        wait_until(lambda: daemon.ask("status")["recording"]["rows"] > rows + 100)
        status = daemon.ask("status")["recording"]
        assert (status["paused"], status["rows_lost"], status["part"]) == (False, 0, 1)
        assert status["disk"]["free_mb"] > 0
        assert daemon.end() == 0, daemon.said
    log = daemon.log()
    pauses = metadata_of(log)["pauses"]
    assert pauses["count"] == 1
    table = pq.read_table(log, columns=["tick", "x.state"])
    (gap,) = np.flatnonzero(np.diff(table["tick"].to_numpy()) > 200)
    assert table["tick"][int(gap)].as_py() == pauses["last"][0]["after_tick"]
    assert table["x.state"][int(gap)].as_py() == AxisState.OFF
    assert metadata_of(log)["rows_lost"] == 0


@pytest.mark.long
@pytest.mark.slow
def test_a_daemon_rotates_while_an_axis_runs_and_what_a_kill_left_is_finished_by_the_next(
    tmp_path: Path,
) -> None:
    with Daemon(tmp_path, bench_config("shuttle") + ROTATING) as daemon:
        daemon.ask("start", axis="x")
        wait_until(lambda: len(logs_of(daemon)) > 1, 120)
        first, second = logs_of(daemon)
        wait_until(lambda: f"log {first}:" in daemon.said, 50)
        assert first.exists()
        status = daemon.ask("status")["recording"]
        assert (status["part"], status["file"]) == (2, str(second))
        pid = daemon.ask("status")["loop"]["pid"]
        assert daemon.end(signal.SIGKILL) == -signal.SIGKILL
        wait_until(lambda: not alive(pid))
        daemon.process = daemon.launch()
        daemon.wait_until_running()
        assert "1 of earlier runs are unfinished" in daemon.said
        wait_until(
            lambda: second.exists() and not any(map(_leftover, stored_logs(daemon.logs, "bench")))
        )
        assert daemon.end() == 0, daemon.said
    ticks = ticks_of([first, second])
    assert (np.diff(ticks) >= 1).all()
    told = metadata_of(first)
    assert (told["successor"], told["rows_lost"]) == (second.name, 0)
    assert metadata_of(second)["recovered"] is True
    assert ticks[-1] + 1 - len(ticks) == sum(
        metadata_of(path)["timing"]["ticks_missing"] for path in (first, second)
    )
    assert not daemon.partial_logs()


def _leftover(log: object) -> bool:
    return log.partial and not in_use(log)  # type: ignore[attr-defined]
