"""`close-loop --resume`: what was run whole before is not run again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from daemon_rig import bench_config
from refine_bench import given_diagnosis
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.close_loop import rigs
from motorctl.close_loop import rounds as rounds_module
from motorctl.close_loop.rigs import ResumedRig
from motorctl.close_loop.run_folder import prepared, refuse_recordings_of_a_machine
from motorctl.config import Machine, load
from motorctl.errors import RunError, UsageError
from motorctl.log import LogWriter
from motorctl.log.info import describe


class CountedRig:
    """Writes a log at once, or trips."""

    verb = "counting"
    goes_on = False

    def __init__(self, runs_on: str = "virtual time") -> None:
        self.runs_on = runs_on
        self.runs = 0
        self.trips = False

    def insist(self, machine: Machine) -> None:
        """Any machine will do."""

    def run(self, machine: Machine, log: Path, duration_s: float | None, progress: Any) -> None:
        """Count it."""
        self.runs += 1
        if self.trips:
            raise RunError("axis x tripped")
        log.write_text("a log")

    def keep(self, machine: Machine) -> None:
        """Nothing runs on."""


def test_only_what_was_run_whole_on_the_same_machine_is_passed_over(tmp_path: Path) -> None:
    counted, machine = CountedRig(), load("published_gantry")
    rig, log = ResumedRig(counted, reuse=True), tmp_path / "own.parquet"

    def run(of: Machine, duration_s: float | None = None) -> int:
        rig.run(of, log, duration_s, lambda _: None)
        return counted.runs

    assert run(machine) == 1
    assert run(machine) == 1
    assert run(machine, 3.0) == 2  # another length
    assert run(load("published_gantry", "C1"), 3.0) == 3  # another machine
    log.unlink()
    assert run(load("published_gantry", "C1"), 3.0) == 4  # its log is gone
    counted.trips = True
    for runs in (5, 6):  # what tripped is tried again
        with pytest.raises(RunError, match="axis x tripped"):
            run(machine)
        assert counted.runs == runs


def test_what_was_simulated_is_not_taken_for_the_machines_own(tmp_path: Path) -> None:
    machine, log = load("published_gantry"), tmp_path / "own.parquet"
    rigs_ = [CountedRig("virtual time"), CountedRig("machine gantry"), CountedRig("machine gantry")]
    for rig in rigs_:
        ResumedRig(rig, reuse=True).run(machine, log, None, lambda _: None)
    assert [rig.runs for rig in rigs_] == [1, 1, 0]


def test_without_resume_everything_is_run(tmp_path: Path) -> None:
    counted, machine = CountedRig(), load("published_gantry")
    rig = ResumedRig(counted, reuse=False)
    for _ in range(2):
        rig.run(machine, tmp_path / "own.parquet", None, lambda _: None)
    assert counted.runs == 2


def test_what_a_loop_that_was_killed_left_of_a_log_is_in_nobodys_way(tmp_path: Path) -> None:
    machine, log = load("published_gantry"), tmp_path / "own.parquet"
    unfinished = tmp_path / "own.parquet.partial"
    unfinished.write_text("as far as it came")
    ResumedRig(CountedRig(), reuse=True).run(machine, log, None, lambda _: None)
    assert not unfinished.exists()
    writer = LogWriter(log, {}, [])  # of another one, that runs now
    ResumedRig(CountedRig(), reuse=False).run(machine, log, None, lambda _: None)
    assert unfinished.exists()
    writer.discard()


@pytest.mark.parametrize(
    ("metadata", "word", "begins"),
    [
        ({}, None, 0),
        ({}, "--resume", 1),
        ({}, "--force", 1),
        ({"virtual_time": {}}, None, 1),  # can be had again
    ],
)
def test_recordings_of_a_machine_go_only_where_somebody_says_so(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    metadata: dict[str, Any],
    word: str | None,
    begins: int,
) -> None:
    config, out = tmp_path / "bench.yaml", tmp_path / "closed"
    config.write_text(bench_config("shuttle"))
    log = out / "round_0" / "own.parquet"
    log.parent.mkdir(parents=True)
    LogWriter(log, metadata, []).close()
    runs = []

    def begun(_machine: Machine, log: Path, **_: Any) -> Any:
        runs.append(log)
        raise KeyboardInterrupt

    monkeypatch.setattr(rigs, "simulate", begun)
    words = ["close-loop", str(config), "--out", str(out), *([word] if word else [])]
    result = CliRunner().invoke(make_app(), words)
    assert len(runs) == begins
    if not begins:
        assert isinstance(result.exception, UsageError)
        told = str(result.exception)
        assert told.startswith(f"{log}: an earlier run recorded it on a machine")
        assert "--resume goes on" in told
        assert "--force replaces" in told
        assert log.is_file()


@pytest.mark.parametrize("ends_with", [KeyboardInterrupt, RunError])
def test_what_was_simulated_is_replaced_however_it_ended(
    tmp_path: Path, ends_with: type[BaseException]
) -> None:
    machine, log = load("published_gantry"), tmp_path / "round_0" / "own.parquet"
    log.parent.mkdir()

    def ended(_share: float) -> None:
        raise ends_with

    with pytest.raises(ends_with):
        rigs.simulate(machine, log, duration_s=60.0, progress=ended)
    assert log.is_file()
    refuse_recordings_of_a_machine(tmp_path)
    assert "virtual time" in " ".join(describe(log).notes)


def test_a_log_that_cannot_be_read_is_not_said_to_be_a_machines(tmp_path: Path) -> None:
    log = tmp_path / "round_1" / "rich.parquet"
    log.parent.mkdir()
    log.write_bytes(b"PAR1 and no more")
    with pytest.raises(UsageError) as refused:
        refuse_recordings_of_a_machine(tmp_path)
    assert str(refused.value).startswith(f"{log}: cannot be read")
    assert "may be an earlier run's" in str(refused.value)
    assert "--force replaces" in str(refused.value)


def test_a_new_run_leaves_nothing_of_an_earlier_one(tmp_path: Path) -> None:
    config = tmp_path / "own.yaml"
    kept = tmp_path / "out" / "moved_minutes.json"
    names = ("round_0/own", "round_1/attempt_1/own", "matched_velocity/own")
    logs = [tmp_path / "out" / f"{name}.parquet" for name in names]  # no configuration beside
    pages = [tmp_path / "out" / name for name in ("refined.yaml", "report.html")]
    picture = tmp_path / "out" / "tracking_error_x_own.png"
    for file in (config, kept, *logs, *pages, picture):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("an earlier one's")
    prepared(tmp_path / "out", config, resume=True)
    assert all(file.is_file() for file in (*logs, *pages, picture))
    folder = prepared(tmp_path / "out", config, resume=False)
    assert sorted((tmp_path / "out").iterdir()) == [kept, folder]
    assert not any(folder.iterdir())


def test_recordings_with_a_matched_velocity_are_guarded_as_well(tmp_path: Path) -> None:
    log = tmp_path / "matched_velocity" / "own.parquet"
    log.parent.mkdir()
    LogWriter(log, {}, []).close()
    with pytest.raises(UsageError, match="an earlier run recorded it on a machine"):
        refuse_recordings_of_a_machine(tmp_path)


def test_a_folder_that_no_run_made_keeps_its_files(tmp_path: Path) -> None:
    notes = tmp_path / "round_1" / "notes.txt"
    own = tmp_path / "refined.yaml"
    notes.parent.mkdir()
    for file in (notes, own):
        file.write_text("somebody's own")
    prepared(tmp_path, tmp_path / "own.yaml", resume=False)
    assert notes.is_file()
    assert own.is_file()


@pytest.mark.parametrize("name", ["refined.yaml", "round_1/attempt_1/config.yaml"])
def test_a_configuration_that_would_be_removed_is_not_begun_with(tmp_path: Path, name: str) -> None:
    (tmp_path / "round_0").mkdir()
    (tmp_path / "round_0" / "config.yaml").write_text("an earlier one's")
    config = tmp_path / name
    config.parent.mkdir(parents=True, exist_ok=True)
    config.write_text("what came out of it")
    with pytest.raises(UsageError, match="choose another --out"):
        prepared(tmp_path, config, resume=False)
    assert config.is_file()
    prepared(tmp_path, config, resume=True)


@pytest.mark.slow
def test_a_loop_that_broke_off_goes_on_with_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config, out = tmp_path / "bench.yaml", tmp_path / "closed"
    config.write_text(bench_config("shuttle"))
    words = ["close-loop", str(config), "--out", str(out), "--rounds", "1"]
    words += ["--duration", "4"]
    simulate, runs = rigs.simulate, []

    def counted(machine: Machine, log: Path, **more: Any) -> Any:
        runs.append(log.name)
        if len(runs) == 2:
            raise KeyboardInterrupt
        return simulate(machine, log, **more)

    monkeypatch.setattr(rigs, "simulate", counted)
    monkeypatch.setattr(rounds_module, "diagnose_recording", given_diagnosis)
    CliRunner().invoke(make_app(), words)
    assert runs == ["own.parquet", "unused.parquet"]
    first = (out / "round_0" / "own.parquet").stat().st_mtime_ns
    result = CliRunner().invoke(make_app(), [*words, "--resume"])
    assert result.exit_code == 0, result.output
    assert (out / "round_0" / "own.parquet").stat().st_mtime_ns == first
    assert runs[2] == "unused.parquet"
    assert (out / "refined.yaml").is_file()
