"""`subscribe`: every row of the loop as arrays, by a descriptor that cannot write."""

from __future__ import annotations

import asyncio
import mmap
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daemon_rig import Daemon, bench_config
from recorded_ring import AXES, Ring, ring
from served_socket import served

import motorctl
from motorctl.api import samples as samples_module
from motorctl.api.samples import Subscription
from motorctl.daemon.access import Role
from motorctl.daemon.client import Client
from motorctl.daemon.protocol import Request
from motorctl.loop.layout import signature

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.slow]


class Stage:
    """A ring that a test fills, behind a control socket."""

    def __init__(self, filled: Ring) -> None:
        self.filled = filled
        self.models_row = 0
        self.signature: str | None = None
        self.theta = {axis.name: axis.theta_names for axis in AXES}

    async def handle(self, _: Request) -> dict[str, Any]:
        axes = {
            name: {"theta_names": names, "dual_drive": False} for name, names in self.theta.items()
        }
        told = {"machine": "bench", "rate_hz": self.filled.rate_hz, "models_row": self.models_row}
        layout = self.filled.memory.layout
        mark = self.signature or signature(layout)
        return told | {"layout": layout, "signature": mark, "axes": axes}


@contextmanager
def staged(place: Path) -> Iterator[tuple[Stage, Path]]:
    with ring() as filled:
        stage = Stage(filled)
        to_read = filled.memory.open_to_read
        with served(place, stage.handle, lambda: Role.OBSERVE, to_read) as path:
            yield stage, path


def subscribed(path: Path, **options: Any) -> Subscription:
    usual = {"period_s": 0.01, "history_s": 0.0, "restarts": False}
    return Subscription(path, **usual | options)


def test_rows_are_arrays_under_the_names_that_logs_have(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (stage, path), subscribed(path) as samples:
        stage.filled.run(100)
        read = samples.read()
        assert read["tick"].tolist() == list(range(100))
        assert read["y.position_m"] == pytest.approx(1e-3 * np.arange(100))
        assert read.units["y.position_m"] == "m"
        assert read.axes == samples.axes == ("x", "y")
        assert "x.theta_hat_offset" in read
        assert "y.theta_hat_offset" not in read
        assert "x.skew_m" not in read
        assert len(read.to_pandas()) == 100
        assert samples.read().rows == 0


def test_a_reader_that_is_too_slow_is_told_how_much_it_lost(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (stage, path), subscribed(path) as samples:
        rows = stage.filled.memory.ring_rows
        stage.filled.run(rows + 500)
        read = samples.read()
        assert (read.lost, read["tick"][0], read.rows) == (501, 501, rows - 1)
        assert samples.lost == 501
        stage.filled.run(10)
        assert (samples.read().lost, samples.lost) == (0, 501)


def test_what_was_before_the_subscription_can_be_had(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (stage, path):
        stage.filled.run(1000)
        with subscribed(path, history_s=0.2) as samples:
            assert samples.read()["tick"][0] == 800


def test_rows_of_other_models_come_apart_with_their_own_columns(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (stage, path), subscribed(path) as samples:
        stage.filled.run(100)
        stage.filled.memory.status["models_row"][0] = 100
        stage.filled.run(50)
        old = samples.read()
        assert (old.rows, "x.theta_hat_cogging_sin_1" in old) == (100, False)
        assert samples.read().rows == 0, "the daemon does not say yet what they are like"
        stage.models_row = 100
        stage.theta["x"] = ("inertia", "cogging_sin_1")
        new = samples.read()
        assert (new["tick"][0], new.rows) == (100, 50)
        assert "x.theta_hat_cogging_sin_1" in new


def change_models(stage: Stage, theta: tuple[str, ...]) -> None:
    """Let other models take over, as the loop notes it; the daemon tells of them at once."""
    status = stage.filled.memory.status
    status["models_row_before"] = status["models_row"]
    status["models_row"] = stage.models_row = stage.filled.rows
    stage.theta["x"] = theta


def test_rows_between_two_changes_of_models_are_not_read_with_the_columns_of_others(
    tmp_path: Path,
) -> None:
    with staged(tmp_path / "s") as (stage, path), subscribed(path) as samples:
        for rows, theta in ((100, ("inertia", "viscous")), (50, ("inertia", "cogging_sin_1"))):
            stage.filled.run(rows)
            change_models(stage, theta)
        stage.filled.run(30)
        read = samples.read()
        assert (read["tick"][0], read.rows, read.lost, samples.lost) == (150, 30, 150, 150)
        assert "x.theta_hat_cogging_sin_1" in read
        change_models(stage, ("inertia", "offset"))
        stage.filled.run(20)
        assert [samples.read().rows for _ in range(2)] == [20, 0]
        assert samples.lost == 150


def test_rows_that_were_held_for_models_that_went_again_are_counted_as_lost(
    tmp_path: Path,
) -> None:
    with staged(tmp_path / "s") as (stage, path), subscribed(path) as samples:
        stage.filled.run(100)
        change_models(stage, ("inertia", "viscous"))
        stage.filled.run(50)
        assert samples.read().rows == 100
        change_models(stage, ("inertia", "cogging_sin_1"))
        stage.filled.run(30)
        read = samples.read()
        assert (read["tick"][0], read.rows, read.lost, samples.lost) == (150, 30, 50, 50)
        assert "x.theta_hat_cogging_sin_1" in read


def test_rows_of_models_that_nobody_tells_any_more_are_counted_as_lost(tmp_path: Path) -> None:
    with ring() as filled:
        stage, to_read = Stage(filled), filled.memory.open_to_read
        with served(tmp_path / "s", stage.handle, lambda: Role.OBSERVE, to_read) as path:
            samples = subscribed(path, restarts=True)
            filled.run(10)
            assert samples.read().rows == 10
            filled.memory.status["models_row"][0] = 10
            filled.run(5)
            assert samples.read().rows == 0
        with served(tmp_path / "s", stage.handle, lambda: Role.OBSERVE, to_read):
            stage.models_row = 10
            following = iter(samples)
            filling = threading.Timer(1.0, filled.run, (7,))
            filling.start()
            batch = next(following)
            assert (batch.run, batch.rows, samples.lost) == (1, 7, 5)
            filling.join()
            samples.close()


def test_who_reads_without_iterating_is_told_of_the_end_after_the_last_row(tmp_path: Path) -> None:
    with ring() as filled:
        stage, to_read = Stage(filled), filled.memory.open_to_read
        with served(tmp_path / "s", stage.handle, lambda: Role.OBSERVE, to_read) as path:
            samples = subscribed(path)
            assert (samples.read().rows, samples.ended) == (0, False)
            filled.run(10)
        assert (samples.read().rows, samples.ended) == (10, True)
        assert (samples.read().rows, samples.ended) == (0, True)
        samples.close()


def next_batch(samples: Subscription) -> list[BaseException | motorctl.Samples]:
    """Return what comes next, an error too; nothing where it does not come in time."""
    got: list[BaseException | motorctl.Samples] = []

    def take() -> None:
        try:
            got.append(next(iter(samples)))
        except motorctl.MotorctlError as error:
            got.append(error)

    taking = threading.Thread(target=take, daemon=True)
    taking.start()
    taking.join(3.0)
    return got


@pytest.mark.parametrize("hinders", ["version", "layout", "kept out", "permission"])
def test_restarts_wait_for_a_daemon_and_not_for_one_that_hands_nothing_over(
    hinders: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(samples_module, "AGAIN_S", 0.01)

    def no_permission(_: Path) -> None:
        raise motorctl.RunError("permission denied") from PermissionError()

    with ring() as filled:
        stage, to_read = Stage(filled), filled.memory.open_to_read
        with served(tmp_path / "s", stage.handle, lambda: Role.OBSERVE, to_read) as path:
            samples = subscribed(path, restarts=True)
        role: list[Any] = [Role.OBSERVE]
        why = "another version of motorctl"
        if hinders == "version":
            stage.signature = "of other fields"
        elif hinders == "layout":
            monkeypatch.setattr(samples_module, "signature", lambda layout: layout["unknown"])
        elif hinders == "kept out":
            role, why = [None], "group"
        else:
            why = "permission denied"
            monkeypatch.setattr(samples_module, "connected", no_permission)
        with served(tmp_path / "s", stage.handle, lambda: role[0], to_read):
            (error,) = next_batch(samples)
        assert isinstance(error, motorctl.MotorctlError)
        assert why in str(error)


def test_a_daemon_of_another_version_is_not_misread(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (stage, path):
        stage.signature = "of other fields"
        with pytest.raises(motorctl.RunError, match="another version of motorctl"):
            subscribed(path)


def test_who_may_only_look_cannot_write_into_what_it_is_handed(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (stage, path):
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(path))
            client.sendall(b'{"id": 1, "do": "samples"}\n')
            _, (descriptor,), *_ = socket.recv_fds(client, 65536, 4)
        size = os.fstat(descriptor).st_size
        with pytest.raises(PermissionError):
            mmap.mmap(descriptor, size, prot=mmap.PROT_WRITE)
        with mmap.mmap(descriptor, size, prot=mmap.PROT_READ) as seen:
            stage.filled.memory.status["overruns"][0] = 77
            place = 4096 + stage.filled.memory.status.dtype.fields["overruns"][1]
            assert seen[place] == 77
        os.close(descriptor)
        with Client(path) as client_, pytest.raises(motorctl.DaemonRefusedError) as no:
            client_.ask("stop", axis="x")
        assert no.value.code == "forbidden"


def open_descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_a_client_that_asks_and_never_reads_leaves_no_descriptors_behind(tmp_path: Path) -> None:
    with staged(tmp_path / "s") as (_, path), Client(path) as first:
        first.ask("status")
        before = open_descriptors()
        with socket.socket(socket.AF_UNIX) as deaf:
            deaf.connect(str(path))
            deaf.sendall(b'{"id": 1, "do": "samples"}\n' * 150)
            deadline = time.monotonic() + 1.0
            while time.monotonic() < deadline:
                assert first.ask("status")["machine"] == "bench"
        deadline = time.monotonic() + 5.0
        while open_descriptors() > before and time.monotonic() < deadline:
            time.sleep(0.01)
        assert open_descriptors() <= before


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with Daemon(tmp_path_factory.mktemp("daemon"), bench_config()) as running:
        yield running


def test_rows_of_a_daemon_are_those_of_its_log_across_its_restart(daemon: Daemon) -> None:
    read: list[motorctl.Samples] = []
    earlier = set(daemon.logs.glob("*.parquet"))  # of runs that other tests ended
    with motorctl.connect(daemon.socket) as machine:
        machine.start("x", hold=True)
        with machine.subscribe(period_s=0.05, restarts=True) as samples:
            machine.move("x", 0.06)
            for batch in samples:
                if not read:
                    read.append(batch)
                elif batch.run == 0:
                    read.append(batch)
                    if len(read) == 10:
                        assert daemon.end() == 0
                        daemon.process = daemon.launch()
                else:
                    assert batch["tick"][0] < 4000
                    break
    (path,) = set(daemon.logs.glob("*.parquet")) - earlier
    log = motorctl.open_log(path)
    ticks = np.concatenate([batch["tick"] for batch in read])
    kept = log["tick"] >= ticks[0]  # a period that the computer missed has no row in either
    assert (ticks == log["tick"][kept]).all(), "each row once, to the last"
    assert sum(batch.lost for batch in read) == samples.lost == 0
    for name in ("x.position_m", "x.command_v", "y.theta_hat_inertia", "x.state"):
        assert (np.concatenate([batch[name] for batch in read]) == log[name][kept]).all(), name
    assert len(ticks) > 200
    assert read[0].units == log.units
    assert log.units["y.theta_hat_inertia"] == "V*s^2/m"


def test_a_subscription_ends_with_its_daemon(daemon: Daemon) -> None:
    daemon.wait_until_running()

    async def to_the_end() -> int:
        async with motorctl.connect_async(daemon.socket) as machine:
            rows = 0
            async for batch in await machine.subscribe(period_s=0.02):
                if not rows:
                    daemon.process.terminate()
                rows += batch.rows
            return rows

    assert asyncio.run(to_the_end()) > 0
    assert daemon.process.wait(30.0) == 0
    with pytest.raises(motorctl.RunError, match="no daemon answers"):
        motorctl.connect(daemon.socket)
