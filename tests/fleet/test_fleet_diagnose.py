"""`motorctl fleet diagnose` looks at every log once, whatever ends it."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import dask
import psutil
import pytest
from distributed import LocalCluster
from fleet_bench import head_of
from fleet_logs import plant_log, told_anew
from typer.testing import CliRunner

import motorctl
from motorctl.cli import make_app
from motorctl.errors import RunError, UsageError
from motorctl.fleet import cluster as cluster_module
from motorctl.fleet.cluster import engine
from motorctl.fleet.findings import table_of_log
from motorctl.fleet.log_index import LogIndex
from motorctl.fleet.run import FleetRun, diagnose_fleet
from motorctl.fleet.store import key_of, open_store
from motorctl.version import VERSION

MAIN = "from motorctl.cli import main; main()"
BEGAN = datetime(2026, 3, 1, 6, tzinfo=UTC)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Run a cluster as somebody else would, for all tests here."""
    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def logs(good_log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two machines of three logs in all, and two that cannot be used."""
    folder = tmp_path_factory.mktemp("logs")
    told_anew(good_log, folder / "one" / "a.parquet", started=BEGAN)
    told_anew(good_log, folder / "one" / "b.parquet", started=BEGAN + timedelta(hours=8))
    told_anew(good_log, folder / "two" / "a.parquet", machine="stage-2", started=BEGAN)
    (folder / "two" / "cut.parquet").write_bytes(good_log.read_bytes()[:-100])
    (folder / "two" / "empty.parquet").write_bytes(b"")
    return folder


def look(logs: Path, store: Path, scheduler: str, **options: Any) -> FleetRun:
    asked = {"model": "C1", "diagnoses": 0, "scheduler": scheduler} | options
    return diagnose_fleet([f"{logs}/**/*.parquet"], store, **asked)


def content(store: Path) -> list[dict[str, Any]]:
    table = open_store(store).read().drop_columns(["written_utc", "source"])
    return sorted(table.to_pylist(), key=lambda row: json.dumps(row, default=str, sort_keys=True))


def files(store: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in store.glob("findings/*/*.parquet")}


@pytest.mark.slow
def test_bad_logs_are_told_and_the_others_are_looked_at_once(
    logs: Path, tmp_path: Path, scheduler: str
) -> None:
    store, shares = tmp_path / "store", []
    run = look(logs, store, scheduler, progress=lambda _, share: shares.append(share))

    assert (run.logs, run.looked_at, run.known) == (5, 3, 0)
    assert [Path(each.source).name for each in run.refused] == ["cut.parquet", "empty.parquet"]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    machines = open_store(store).read(["machine", "name"]).to_pylist()
    assert sum(row == {"machine": "stage-1", "name": "inertia"} for row in machines) == 2

    before = files(store)
    again = look(logs, store, scheduler)
    assert (again.looked_at, again.known, len(again.refused)) == (0, 3, 2)
    assert files(store) == before

    shutil.copy(logs / "one" / "a.parquet", tmp_path / "renamed.parquet")
    moved = look(tmp_path, store, scheduler)
    assert (moved.looked_at, moved.known) == (0, 1)

    other = look(logs / "two", store, scheduler, model="C2")
    assert (other.looked_at, other.known) == (1, 0)


@pytest.mark.slow
def test_the_command_tells_what_it_did_and_exits_by_it(
    logs: Path, tmp_path: Path, scheduler: str
) -> None:
    def run(*words: str) -> Any:
        fixed = ("--store", str(tmp_path / "store"), "--scheduler", scheduler, "--json")
        told = ("--model", "C1", "--diagnoses", "0")
        return CliRunner().invoke(make_app(), ["fleet", "diagnose", *words, *fixed, *told])

    sound = run(f"{logs}/one/*.parquet")
    assert sound.exit_code == 0, sound.output
    assert json.loads(sound.stdout)["looked_at"] == 2
    some = run(f"{logs}/**/*.parquet")
    assert some.exit_code == 3
    document = json.loads(some.stdout)
    assert {Path(each["source"]).name for each in document["refused"]} == {
        "cut.parquet",
        "empty.parquet",
    }
    assert run(f"{logs}/two/cut.parquet").exit_code == 2


def test_what_cannot_begin_is_told_at_once(good_log: Path, tmp_path: Path, scheduler: str) -> None:
    store = tmp_path / "store"
    with pytest.raises(UsageError, match="no file is meant by it"):
        diagnose_fleet([f"{tmp_path}/*.parquet"], store, scheduler=scheduler)
    with pytest.raises(UsageError, match="cannot be reached"):
        diagnose_fleet(["nowhere://a/*.parquet"], store, scheduler=scheduler)
    with pytest.raises(UsageError, match="--workers is of a local cluster"):
        diagnose_fleet([str(good_log)], store, scheduler=scheduler, workers=2)
    with pytest.raises(UsageError, match="--diagnoses -1"):
        diagnose_fleet([str(good_log)], store, scheduler=scheduler, diagnoses=-1)


@pytest.mark.slow
def test_a_log_that_is_there_twice_is_one_and_its_flight_records_are_no_other_machine(
    good_log: Path, tmp_path: Path, scheduler: str
) -> None:
    log = told_anew(good_log, tmp_path / "log.parquet", started=BEGAN, rest_s=90.0)
    shutil.copy(log, tmp_path / "copy.parquet")
    flight = {"started": BEGAN + timedelta(seconds=5), "flight_record": {"axis": "x"}}
    told_anew(good_log, tmp_path / "faults" / "record.parquet", **flight)
    head = head_of(log)
    key = key_of(head.log_id, head.model_id, 0)
    store = open_store(tmp_path / "store", create=True)
    store.write(key, BEGAN, table_of_log(head, key, []))

    run = look(tmp_path, store.folder, scheduler)

    assert not run.refused
    assert (run.logs, run.known, run.twins, run.copies) == (3, 1, 1, 1)


@pytest.mark.slow
def test_a_log_that_was_moved_is_known_and_the_store_tells_where_it_is(
    good_log: Path, tmp_path: Path, scheduler: str
) -> None:
    log = told_anew(good_log, tmp_path / "log.parquet", started=BEGAN)
    head = head_of(log)
    key = key_of(head.log_id, head.model_id, 0)
    store = open_store(tmp_path / "store", create=True)
    row = {"axis": "x", "kind": "nothing", "text": "at rest"}
    store.write(key, BEGAN, table_of_log(head, key, [row]))
    (tmp_path / "archive").mkdir()
    moved = tmp_path / "archive" / "log.parquet"
    moved.write_bytes(log.read_bytes()[:-100])  # the copy is not whole in the first night
    assert len(look(tmp_path / "archive", store.folder, scheduler).refused) == 1
    assert "refused" in open_store(store.folder).read(["kind"]).column("kind").to_pylist()
    log.rename(moved)

    told_anew(good_log, tmp_path / "archive" / "old.parquet", started="1970-01-01T00:00:09+00:00")
    run = look(tmp_path / "archive", store.folder, scheduler)

    (refused,) = store.passing()
    assert (Path(refused.source).name, refused.machine) == ("old.parquet", "stage-1")
    assert (run.known, run.looked_at) == (1, 0)
    assert store.sources() == {key: str(moved)}  # and nothing is left of the copy
    assert LogIndex(store.folder).find(head.log_id) == moved
    before = files(store.folder)
    shutil.copy(moved, tmp_path / "archive" / "again.parquet")
    look(tmp_path / "archive", store.folder, scheduler)
    assert files(store.folder) == before  # where the store says that it is, it is


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_told_with_what_to_do(
    good_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_S", 3.0)  # so long it is asked for once more
    with LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:

        def go_away(_: str, __: float) -> None:
            cluster.close()

        with pytest.raises(RunError, match="the same command does the rest"):
            diagnose_fleet(
                [str(good_log)],
                tmp_path / "store",
                model="C1",
                diagnoses=0,
                scheduler=cluster.scheduler_address,
                progress=go_away,
            )


def test_workers_without_motorctl_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    asked_of(monkeypatch, [{"one": ModuleNotFoundError("No module named 'motorctl'")}])
    with (
        pytest.raises(UsageError, match="its workers have no motorctl"),
        engine("tcp://127.0.0.1:1", None),
    ):
        pass


def test_a_worker_that_was_just_ended_does_not_keep_a_run_from_beginning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gone = OSError("Timed out trying to connect")
    asked = asked_of(monkeypatch, [{"one": gone}, {}, {"one": gone, "two": VERSION}])
    with engine("tcp://127.0.0.1:1", None):
        assert len(asked) == 3


def test_a_cluster_whose_workers_are_all_gone_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motorctl.fleet.cluster.CONNECT_S", 0.0)
    asked_of(monkeypatch, [{"one": OSError("Connection refused")}] * 9)
    with (
        pytest.raises(UsageError, match="it has no workers"),
        engine("tcp://127.0.0.1:1", None),
    ):
        pass


def asked_of(
    monkeypatch: pytest.MonkeyPatch, answers: list[dict[str, str | Exception]]
) -> list[object]:
    """Let a cluster's workers answer so, one time after the other, as distributed does."""
    asked: list[object] = []

    def run(call: object, on_error: str = "raise") -> dict[str, str | Exception]:
        asked.append(call)
        told = answers[len(asked) - 1]
        for answer in told.values():
            if isinstance(answer, Exception) and on_error == "raise":
                raise answer
        return told

    client = MagicMock()
    client.return_value.run = run
    monkeypatch.setattr("motorctl.fleet.cluster.Client", client)
    return asked


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_told(
    good_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_S", 1.0)
    with pytest.raises(UsageError, match="does not answer"):
        diagnose_fleet([str(good_log)], tmp_path / "store", scheduler="tcp://127.0.0.1:9")


@pytest.mark.slow
def test_a_local_cluster_listens_on_loopback_alone() -> None:
    with engine(None, 2) as client:
        client.submit(len, "x").result()
        processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
        listening = {
            connection.laddr.ip
            for process in processes
            for connection in process.net_connections("tcp")
            if connection.status == psutil.CONN_LISTEN
        }
    assert listening == {"127.0.0.1"}


@pytest.mark.slow
def test_a_local_worker_that_is_killed_is_begun_anew_however_long_that_takes() -> None:
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "10 ms"}),
        engine(None, 1) as client,
    ):
        (pid,) = client.run(os.getpid).values()
        os.kill(pid, signal.SIGKILL)
        assert client.submit(len, "x", pure=False).result(timeout=60) == 1


@pytest.mark.slow
def test_the_diagnosis_of_a_log_is_that_of_diagnose(
    good_log: Path, tmp_path: Path, scheduler: str
) -> None:
    store = tmp_path / "store"
    diagnose_fleet([str(good_log)], store, model="C1", scheduler=scheduler)
    told = motorctl.diagnose(good_log, model="C1").axes["x"]
    kept = open_store(store).read().to_pylist()
    (verdict,) = (row for row in kept if row["kind"] == "verdict")
    assert (verdict["name"], verdict["text"]) == (told.verdict, told.sentence)
    effects = {row["name"]: row for row in kept if row["kind"] == "effect"}
    assert set(effects) == {found.name for found in told.effects}
    for found in told.effects:
        # the worker's linear algebra has one thread, and rounds otherwise
        assert effects[found.name]["confidence"] == pytest.approx(found.confidence, abs=1e-6)


@pytest.mark.slow
def test_a_run_that_is_killed_is_gone_on_with_and_finds_the_same(
    tmp_path: Path, scheduler: str
) -> None:
    folder, broken = tmp_path / "logs", tmp_path / "broken"
    for k in range(6):
        plant_log(folder / f"{k}.parquet", seed=k, started=BEGAN + timedelta(hours=8 * k))
    words = ["fleet", "diagnose", f"{folder}/*.parquet", "--model", "C1", "--diagnoses", "0"]
    command = [sys.executable, "-c", MAIN, *words, "--workers", "1", "--store", str(broken)]
    for aim in (1, 3):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
        deadline = time.monotonic() + 120.0
        while len(files(broken)) < aim and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.005)
        os.killpg(process.pid, signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    kept = files(broken)
    assert 3 <= len(kept) < 6

    last = look(folder, broken, scheduler)
    assert (last.known, last.looked_at) == (len(kept), 6 - len(kept))
    assert {name: files(broken)[name] for name in kept} == kept
    look(folder, tmp_path / "whole", scheduler)
    assert content(broken) == content(tmp_path / "whole")
    names = open_store(broken).read(["name"]).column("name").to_pylist()
    assert names.count("inertia") == 6
