"""`close-loop --socket`: the rounds on a running daemon, broken off and gone on with."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from daemon_rig import Daemon, bench_config
from refine_bench import THETA, given_diagnosis
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.close_loop import machine_rig, telling
from motorctl.close_loop import rounds as rounds_module
from motorctl.close_loop.motion import Motions
from motorctl.close_loop.rigs import BrokenOffError
from motorctl.daemon.client import Client
from motorctl.daemon.running_machine import machine_of_daemon
from motorctl.errors import MotorctlError, UsageError
from motorctl.experiment.candidates import Candidate
from motorctl.experiment.session import Experiment, Standing
from motorctl.identify.diagnose.report.motion_advice import Stroke
from motorctl.log import read_recording

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.slow]


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    document = yaml.safe_load(bench_config("shuttle"))
    shuttle = document["programs"]["shuttle"]
    # brisk: what is made for the machine is as fast as its own motion, and over all its travel
    shuttle |= {"distance_m": 0.2, "max_velocity_m_s": 0.5, "max_acceleration_m_s2": 2}
    document["programs"]["beside"] = shuttle | {"axis": "y", "distance_m": 0.16}
    document["axes"]["y"]["program"] = "beside"
    with Daemon(tmp_path_factory.mktemp("close"), yaml.safe_dump(document)) as running:
        yield running


def asked(daemon: Daemon, config: Path, *words: object) -> Any:
    arguments = ["close-loop", str(config), *daemon.at, "--yes", *map(str, words)]
    return CliRunner().invoke(make_app(), arguments)


def close(daemon: Daemon, config: Path, *words: object) -> Any:
    result = asked(daemon, config, *words)
    if isinstance(result.exception, MotorctlError | KeyboardInterrupt):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result


def test_a_configuration_of_another_machine_is_refused_with_the_key(daemon: Daemon) -> None:
    document = yaml.safe_load(daemon.config.read_text())
    document["axes"]["y"]["limits"]["max_voltage_v"] = 9
    path = daemon.config.with_name("another.yaml")
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(UsageError, match=r"axes\.y\.limits\.max_voltage_v is 9.*runs 10"):
        close(daemon, path, "--out", daemon.config.parent / "another")
    assert daemon.state("x") == "off"


@pytest.mark.slow
def test_what_breaks_it_off_stops_the_axes_and_resume_goes_on(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = Path(tempfile.mkdtemp(dir=daemon.config.parent)) / "closed"  # begun anew: another one
    words = ("--out", out, "--rounds", 1, "--motion", "own", "--duration", 2, "--json")
    waited = machine_rig.MachineRig._wait
    runs: list[str] = []

    def interrupted(self: Any, names: Any, seconds: float, progress: Any) -> None:
        runs.append("run")
        if len(runs) == 2:
            raise KeyboardInterrupt
        waited(self, names, seconds, progress)

    monkeypatch.setattr(machine_rig.MachineRig, "_wait", interrupted)
    monkeypatch.setattr(rounds_module, "diagnose_recording", given_diagnosis)
    broken_off = asked(daemon, daemon.config, *words)
    assert broken_off.exit_code != 0
    assert "keeps 1 of 2 motions that were begun" in broken_off.stderr
    assert "with --resume goes on after them" in broken_off.stderr
    assert daemon.state("x") in ("off", "stopping")
    first = (out / "round_0" / "own.parquet").stat().st_mtime_ns
    before = len(runs)
    result = close(daemon, daemon.config, *words, "--resume")
    assert (out / "round_0" / "own.parquet").stat().st_mtime_ns == first
    assert len(runs) > before
    document = json.loads(result.stdout.splitlines()[-1])
    assert document["rounds"]
    assert (out / "round_1" / "attempt_1" / "own.parquet").is_file()  # with another model
    log = out / "round_0" / "own.parquet"
    alone = CliRunner().invoke(make_app(), ["diagnose", str(log), "--axis", "x", "--json"])
    inertia = json.loads(alone.stdout)["axes"]["x"]["parameters"]["inertia"]["value"]
    assert inertia == pytest.approx(THETA["x"][0], rel=0.5)  # of two seconds
    assert (out / "refined.yaml").is_file()


@pytest.mark.slow
def test_an_axis_that_somebody_stops_is_not_started_again(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("--out", daemon.config.parent / "stopped", "--rounds", 1, "--motion", "own")
    waited = machine_rig.MachineRig._wait

    def stopped(self: Any, names: Any, seconds: float, progress: Any) -> None:
        daemon.ask("stop", axis="x")
        waited(self, names, seconds, progress)

    monkeypatch.setattr(machine_rig.MachineRig, "_wait", stopped)
    result = asked(daemon, daemon.config, *words, "--duration", 3)
    assert isinstance(result.exception, BrokenOffError)
    assert "axis x is" in str(result.exception)
    assert "nothing here stopped it" in str(result.exception)
    assert "keeps 0 of 1 motions that were begun" in result.stderr
    assert {daemon.state(axis) for axis in ("x", "y")} <= {"off", "stopping"}


@pytest.mark.slow
def test_motions_that_are_chosen_one_by_one_are_run_apart_and_read_as_one_recording(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    to_and_fro = Candidate(
        "", "to and fro", {"x": (Stroke(0.55, 0.5, 0.5), Stroke(0.45, 0.5, 0.5))}
    )
    left = [Standing({}, ("x",)), Standing({}, ())]
    monkeypatch.setattr(telling, "_diagnosed", lambda *_: None)
    monkeypatch.setattr(telling, "standing", lambda *_: left.pop(0))
    monkeypatch.setattr(
        telling,
        "next_experiment",
        lambda _now, reaches, *_: Experiment(to_and_fro, to_and_fro.lasts_s(reaches), ()),
    )
    out = daemon.config.parent / "telling"
    out.mkdir(exist_ok=True)  # it may begin anew, after a pause of the computer
    with Client(daemon.socket) as client:
        rig = machine_rig.MachineRig(client, machine_of_daemon(client), lambda *_: None)
        told = telling.record_telling(daemon.config, out, Motions(), rig, lambda *_: None)
    first, second = (read_recording(log, gaps="keep") for log in sorted(out.glob("*.parquet")))
    assert second.time_s[0] > first.time_s[-1]
    assert len(told.recording.time_s) == len(first.time_s) + len(second.time_s)
    assert second.duration_s < first.duration_s + 5.0
    x = second.axes["x"].position
    assert 0.0 < x.max() - x.min() < 0.1
    assert daemon.state("x") in ("off", "idle", "stopping")
