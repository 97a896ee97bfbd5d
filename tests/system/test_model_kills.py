"""Models applied again and again, the daemon killed meanwhile: the old or the new, never half."""

from __future__ import annotations

import random
import signal
import threading
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml
from daemon_rig import Daemon, alive, bench_config, wait_until

from motorctl.daemon.model_history import ModelHistory
from motorctl.errors import MotorctlError
from motorctl.log import recover

KILLS, SWAPS = 50, 200
SEED = 20261126
MOST_MISSED = 100
"""Periods of 2.5 ms that a busy computer may miss in a run; the rows of a second are 400."""

pytestmark = [pytest.mark.slow, pytest.mark.long, pytest.mark.wall_clock]


def other(daemon: Daemon) -> Path:
    document = yaml.safe_load(daemon.config.read_text())
    document["axes"]["x"]["gains"]["ks_v_s_m"] = 12
    path = daemon.config.with_name("other.yaml")
    path.write_text(yaml.safe_dump(document))
    return path


def test_swaps_while_holding_lose_no_row_and_trip_nothing(tmp_path: Path) -> None:
    with Daemon(tmp_path, bench_config()) as daemon:
        for axis in ("x", "y"):
            daemon.ask_when_it_stands("start", axis, hold=True)
        files = [other(daemon), daemon.config]
        for k in range(SWAPS):
            done = daemon.cli("apply", str(files[k % 2]))
            assert done.returncode == 0, done.stderr
            assert daemon.state("x") == "idle"
        skipped = daemon.ask("status")["loop"]["skipped_periods"]
        assert daemon.end() == 0
    ticks: list[int] = []
    for path in sorted(daemon.logs.glob("*.parquet")):
        ticks += pq.read_table(path, columns=["tick"])["tick"].to_pylist()
    assert ticks == sorted(set(ticks))
    # periods that the computer missed have no row in any log
    assert len(range(ticks[0], ticks[-1] + 1)) - len(ticks) == skipped


def test_a_kill_at_any_moment_leaves_whole_logs_and_a_whole_history(tmp_path: Path) -> None:
    rng = random.Random(SEED)
    for k in range(KILLS):
        folder = tmp_path / str(k)
        with Daemon(folder, bench_config()) as daemon:
            daemon.ask_when_it_stands("start", "x", hold=True)
            pid = daemon.ask("status")["loop"]["pid"]
            asking = threading.Thread(target=_apply, args=(daemon,), daemon=True)
            asking.start()
            time.sleep(rng.uniform(0.0, 12.0))
            daemon.process.send_signal(signal.SIGKILL)
            daemon.process.wait()
            wait_until(lambda pid=pid: not alive(pid))  # type: ignore[misc]
            asking.join()
        ticks: list[int] = []
        for partial in daemon.partial_logs():
            ticks += pq.read_table(recover(partial).path, columns=["tick"])["tick"].to_pylist()
        for whole in daemon.logs.glob("*.parquet"):
            ticks += pq.read_table(whole, columns=["tick"])["tick"].to_pylist()
        ticks = sorted(set(ticks))
        # the computer may have missed periods; none of the log before comes again
        assert len(range(ticks[0], ticks[-1] + 1)) - len(ticks) <= MOST_MISSED, k
        history = ModelHistory("bench", folder / "state" / "motorctl" / "models").read()
        assert [change.what for change in history] in ([], ["applied"]), k


def _apply(daemon: Daemon) -> None:
    try:
        daemon.cli("apply", str(other(daemon)))
    except (MotorctlError, OSError):
        return
