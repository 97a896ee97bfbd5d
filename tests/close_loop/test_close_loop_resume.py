"""`close-loop --resume`: what was run whole before is not run again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from daemon_rig import bench_config
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.close_loop import rigs
from motorctl.close_loop.rigs import ResumedRig
from motorctl.config import Machine, load
from motorctl.errors import RunError, UsageError
from motorctl.log import LogWriter


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
    CliRunner().invoke(make_app(), words)
    assert runs == ["own.parquet", "unused.parquet"]
    first = (out / "round_0" / "own.parquet").stat().st_mtime_ns
    result = CliRunner().invoke(make_app(), [*words, "--resume"])
    assert result.exit_code == 0, result.output
    assert (out / "round_0" / "own.parquet").stat().st_mtime_ns == first
    assert runs[2] == "unused.parquet"
    assert (out / "refined.yaml").is_file()
