"""`motorctl tune` on the simulated gantry: tried out before it is written, or refused."""

import json

import pytest
import yaml
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.config.shipped import locate
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.loop.simulation import simulate

TEXT = locate("published_gantry").read_text(encoding="utf-8")
SHORT = TEXT.replace("cycles: 12", "cycles: 4")


def run(*words):
    result = CliRunner().invoke(make_app(), [str(word) for word in ("tune", *words)])
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("tune") / "gantry.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def log(config):
    path = config.with_name("run.parquet")
    simulate(load(config), path)
    return path


@pytest.fixture(scope="module")
def tuned(config, log):
    out = config.with_name("tuned.yaml")
    told = run("y", "--config", config, "--recording", log, "--out", out, "--report",
               config.parent, "--json")  # fmt: skip
    return json.loads(told), out


def test_the_tuned_configuration_is_the_old_one_but_for_three_gains(config, tuned):
    _, out = tuned
    before, after = (yaml.safe_load(p.read_text(encoding="utf-8")) for p in (config, out))
    gains = after["axes"]["y"]["gains"]
    for key in ("k1_1_s", "ks_v_s_m", "gamma_d"):
        assert gains[key] != before["axes"]["y"]["gains"][key]
        gains[key] = before["axes"]["y"]["gains"][key]
    assert after == before


def test_margins_and_errors_are_told_before_and_after(tuned):
    told, out = tuned
    assert told["after"]["margins"]["phase_margin_deg"] >= 30.0
    assert told["after"]["margins"]["gain_margin"] >= 10 ** (6 / 20)
    assert told["after"]["eF_predicted_m"] < told["before"]["eF_m"]
    assert str(out) in told["files"]


def test_the_picture_shows_error_margins_and_noise(tuned):
    told, out = tuned
    picture = out.with_name("tuning_y.png")
    assert str(picture) in told["files"]
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_without_a_log_the_gains_are_tried_out_in_virtual_time(config, tmp_path):
    out = tmp_path / "tuned.yaml"
    told = json.loads(run("y", "--config", config, "--out", out, "--json"))
    tried_m = told["after"]["eF_tried_out_m"]
    assert tried_m < told["before"]["eF_m"]
    assert tried_m == pytest.approx(told["after"]["eF_predicted_m"], rel=0.3)


def test_gains_that_make_it_worse_are_not_written(config, log, tmp_path, monkeypatch):
    from motorctl.tune import tuning

    monkeypatch.setattr(tuning, "record_program", lambda *_: (_ for _ in ()).throw(
        RunError("axis y tripped (following_error): 1.2 mm")))  # fmt: skip
    out = tmp_path / "tuned.yaml"
    machine = load(config)
    from motorctl.log import read_recording
    from motorctl.tune.margins_wanted import margins_wanted

    found = tuning.tune(read_recording(log, gaps="keep"), machine, "y", out,
                        margins_wanted("30deg,6dB", None), lambda *_: None)  # fmt: skip
    beside = tuning.write_checked(found, out)
    with pytest.raises(RunError, match="tripped"):
        tuning.try_out(found, beside, tmp_path / "tuned.parquet", lambda *_: None)
    assert not out.exists()


@pytest.mark.parametrize(
    ("margin", "words"),
    [
        ("30", "should be a phase and a gain margin, as 30deg,6dB"),
        ("30deg,6", "should be a phase and a gain margin"),
        ("3.3.3deg,6dB", "should be a phase and a gain margin"),
        ("5deg,6dB", "should be 10 to 85 deg and 2 to 30 dB"),
        ("30deg,60dB", "should be 10 to 85 deg and 2 to 30 dB"),
    ],
)
def test_margins_that_make_no_sense_are_refused(config, log, tmp_path, margin, words):
    with pytest.raises(UsageError, match=words):
        run("y", "--config", config, "--recording", log, "--margin", margin, "--out",
            tmp_path / "t.yaml")  # fmt: skip


def test_an_unknown_axis_is_refused_with_those_that_there_are(config, log, tmp_path):
    with pytest.raises(UsageError, match=r"no axis 'w'; it has: x, y"):
        run("w", "--config", config, "--recording", log, "--out", tmp_path / "t.yaml")


def test_a_log_of_another_model_is_refused(config, log, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(SHORT.replace("&controller C2", "&controller C1"), encoding="utf-8")
    with pytest.raises(UsageError, match="was recorded with the model"):
        run("y", "--config", other, "--recording", log, "--out", tmp_path / "t.yaml")


def test_a_foreign_recording_is_refused_for_it_does_not_tell_the_gains(config, log, tmp_path):
    import pyarrow.parquet as pq

    table = pq.read_table(log)
    foreign = tmp_path / "foreign.parquet"
    pq.write_table(table.replace_schema_metadata(None), foreign)
    with pytest.raises(UsageError, match="needs a log that motorctl wrote"):
        run("y", "--config", config, "--recording", foreign, "--out", tmp_path / "t.yaml")


def test_gains_behind_an_alias_are_refused_and_nothing_is_written(config, log, tmp_path):
    text = SHORT.replace("gains: {k1_1_s", "gains: &g {k1_1_s", 1)
    head, _, tail = text.rpartition("    gains: {k1_1_s")
    aliased = tmp_path / "aliased.yaml"
    aliased.write_text(f"{head}    gains: *g\n{tail.partition(chr(10))[2]}", encoding="utf-8")
    out = tmp_path / "t.yaml"
    with pytest.raises(UsageError, match="cannot be changed in place"):
        run("y", "--config", aliased, "--recording", log, "--out", out)
    assert list(tmp_path.glob("*t*.yaml")) == []


def test_a_machine_without_a_program_has_nothing_to_lower(tmp_path):
    lines = [line for line in SHORT.splitlines() if not line.strip().startswith("program:")]
    still = tmp_path / "still.yaml"
    still.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(UsageError, match="no axis has a program"):
        run("y", "--config", still, "--out", tmp_path / "t.yaml")
