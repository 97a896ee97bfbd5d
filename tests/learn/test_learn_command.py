"""`motorctl learn` in virtual time and from logs: less error, or what was there before stays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.close_loop.rigs import SimulatedRig
from motorctl.config import load
from motorctl.config.learned_file import learned_path, read_learned
from motorctl.config.shipped import locate
from motorctl.errors import DataError, MotorctlError, RunError, UsageError
from motorctl.learn.learning import with_place
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl.tune.candidates import MarginsWanted
from motorctl.tune.tuning import tune

pytestmark = pytest.mark.slow

TEXT = locate("small_stage").read_text(encoding="utf-8")
LEARNING = TEXT.replace("    program: shuttle", "    program: shuttle\n"
                        "    learning: {file: learned.json}")  # fmt: skip
SHORT = LEARNING.replace("cycles: 10", "cycles: 4")


def learn(*words: object) -> dict[str, Any]:
    result = CliRunner().invoke(make_app(), ["learn", *map(str, words), "--json"])
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    document: dict[str, Any] = json.loads(result.stdout)
    return document


def stage(folder: Path, text: str = SHORT) -> Path:
    path = folder / "stage.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "axis", "words"),
    [
        (TEXT, "x", r"axis x does not learn unless .*`learning: \{file: learned_x\.json\}`"),
        (SHORT, "z", "no axis 'z'; it has: x"),
        (LEARNING.replace("cycles: 10", "cycles: 2"), "x", "has 2 cycles: learning needs 3"),
        (LEARNING.replace("program: shuttle", "program: there"), "x", "'there' does not repeat"),
        (LEARNING.replace("    program: shuttle\n", ""), "x", "axis x has no program"),
    ],
)
def test_what_cannot_learn_is_told_why_and_nothing_is_written(
    tmp_path: Path, text: str, axis: str, words: str
) -> None:
    with pytest.raises(UsageError, match=words):
        learn(axis, "--config", stage(tmp_path, text))
    assert [path.name for path in tmp_path.iterdir()] == ["stage.yaml"]


@pytest.mark.slow
def test_it_learns_goes_on_and_forgets_where_the_model_changes(tmp_path: Path) -> None:
    config = stage(tmp_path)
    told = learn("x", "--config", config, "--repetitions", 4, "--report", tmp_path / "report")
    errors = [trial["rms_m"] for trial in told["trials"]]
    assert errors[told["best"]] < 0.3 * errors[0]
    assert told["trials"][0]["learned_rms_v"] == 0.0
    assert 0.0 < told["learned_peak_v"] <= told["limit_v"]
    assert told["largest_left_over"] < 1.0
    assert {Path(file).name for file in told["files"]} == {"learned.json", "learning_x.png"}
    # Whoever runs the program has it, in a column of its own and in the command.
    log = tmp_path / "run.parquet"
    assert simulate(load(config), log).notes == ()
    recording = read_recording(log, gaps="keep")
    assert max(abs(recording.axes["x"].learned)) > 0.0
    assert any("learned for a program that repeats" in note for note in recording.notes)
    with pytest.raises(DataError, match=r"had learned for its program .*then learn anew"):
        tune(recording, load(config), "x", MarginsWanted(30.0, 2.0), lambda *_: None)
    # It goes on from there, and begins anew where it is told to.
    more = learn("x", "--config", config, "--repetitions", 2)
    assert more["trials"][0]["learned_rms_v"] > 0.0
    assert more["trials"][0]["rms_m"] < 0.3 * errors[0]
    anew = learn("x", "--config", config, "--repetitions", 2, "--anew")
    assert anew["trials"][0]["learned_rms_v"] == 0.0
    # With another model nothing is added, and it is told.
    config.write_text(SHORT.replace("ks_v_s_m: 25", "ks_v_s_m: 26"), encoding="utf-8")
    (note,) = simulate(load(config), log).notes
    assert "with another model" in note
    assert not read_recording(log, gaps="keep").axes["x"].learned.any()


@pytest.mark.slow
def test_a_log_of_each_run_does_as_well(tmp_path: Path) -> None:
    config = stage(tmp_path)
    errors = []
    for k in range(3):
        log = tmp_path / f"run_{k}.parquet"
        simulate(load(config), log)
        told = learn("x", "--config", config, "--recording", log)
        errors.append(told["trials"][-1]["rms_m"])
    assert errors[2] < errors[1] < 0.5 * errors[0]
    path = learned_path(load(config), "x")
    assert path is not None
    assert len(read_learned(path)["shuttle"].trials) == 3


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("ks_v_s_m: 25", "ks_v_s_m: 26"), r"gains\.ks_v_s_m: 25\.0, here 26\.0"),
        (("forgetting_1_s: 0.5", "forgetting_1_s: 0.6"), r"adaptation\.forgetting_1_s: 0\.5, here"),
    ],
)
def test_a_log_of_a_loop_with_other_gains_teaches_nothing(
    tmp_path: Path, change: tuple[str, str], told: str
) -> None:
    log = tmp_path / "run.parquet"
    simulate(load(stage(tmp_path)), log, duration_s=0.05)
    assert change[0] in SHORT
    config = stage(tmp_path, SHORT.replace(*change))
    with pytest.raises(UsageError, match=f"recorded with another loop(.|\n)*{told}"):
        learn("x", "--config", config, "--recording", log)
    assert not (tmp_path / "learned.json").exists()


@pytest.mark.slow
def test_where_the_machine_does_not_add_what_was_written_it_ends_and_tells_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file disappears, as on a machine that reads another one."""
    ran = SimulatedRig.run

    def elsewhere(self: SimulatedRig, machine: Any, *rest: Any) -> None:
        ran(self, with_place(machine, "x", tmp_path / "another.json"), *rest)

    monkeypatch.setattr(SimulatedRig, "run", elsewhere)
    with pytest.raises(RunError, match=r"repetition 2: axis x added 0 V rms, and not the"):
        learn("x", "--config", stage(tmp_path), "--repetitions", 3)
    assert not (tmp_path / "learned.json").exists()


@pytest.mark.slow
@pytest.mark.parametrize("learned_before", [False, True])
def test_where_an_axis_trips_what_was_there_before_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, learned_before: bool
) -> None:
    config, path = stage(tmp_path), tmp_path / "learned.json"
    if learned_before:
        learn("x", "--config", config, "--repetitions", 2)
    before = path.read_bytes() if learned_before else None
    ran = SimulatedRig.run
    runs: list[Path] = []

    def tripping(self: SimulatedRig, machine: Any, log: Path, *rest: Any) -> None:
        runs.append(log)
        if len(runs) == 2:
            raise RunError("axis x tripped (following_error): 2 mm, limit 1 mm")
        ran(self, machine, log, *rest)

    monkeypatch.setattr(SimulatedRig, "run", tripping)
    with pytest.raises(RunError, match=r"repetition 2: axis x tripped.*before stays"):
        learn("x", "--config", config)
    assert len(runs) == 2
    assert (path.read_bytes() if path.exists() else None) == before
