"""`motorctl refine` and `motorctl close-loop` as commands, with a diagnosis that is given."""

import json

import pytest
import typer
from refine_bench import gantry_diagnosis, gantry_log
from typer.testing import CliRunner

from motorctl.cli import close_loop, refine
from motorctl.config import load
from motorctl.errors import DataError, UsageError
from motorctl.identify.diagnose import recording


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return gantry_log(tmp_path_factory.mktemp("log"))


@pytest.fixture
def known(monkeypatch, log):
    """Let the diagnosis find what the gantry has."""

    def diagnose_recording(
        recording, models, progress=None, evaluate_on=None, further=(), inertia=None
    ):
        return gantry_diagnosis(log, axes=tuple(models))

    monkeypatch.setattr(recording, "diagnose_recording", diagnose_recording)


def run(module, *arguments):
    app = typer.Typer()
    module.register(app)
    result = CliRunner().invoke(app, [str(part) for part in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.mark.slow
@pytest.mark.usefixtures("known")
def test_json_tells_what_was_added_and_what_it_is_worth(log, tmp_path):
    out = tmp_path / "new.yaml"
    result = run(refine, log, "--config", "published_gantry", "--out", out, "--json")
    document = json.loads(result.stdout)
    assert document["out"] == str(out)
    for axis in document["axes"].values():
        assert axis["verdict"] == "effect"
        assert axis["effects_added"] == ["cogging", "input_lag", "input_delay"]
        assert axis["error"]["start_values_after_rms"] < axis["error"]["start_values_before_rms"]
        assert axis["error"]["held_out_after_rms"] < axis["error"]["held_out_before_rms"]
        inertia = axis["parameters"]["inertia"]
        assert inertia["before"]["initial"] != inertia["after"]["initial"]
        assert axis["parameters"]["cogging_sin_1"]["before"] is None
    assert load(out).axes["x"].model.names[-1] == "input_delay"


@pytest.mark.usefixtures("known")
def test_people_see_the_change_and_what_to_run_next(log, tmp_path):
    out, report = tmp_path / "new.yaml", tmp_path / "report"
    result = run(
        refine, log, "--config", "published_gantry", "--out", out, "--axis", "y",
        "--report", report,
    )  # fmt: skip
    assert "+      cogging:" in result.stdout
    assert "added cogging" in result.stdout
    assert f"motorctl simulate {out}" in result.stdout
    assert "axis x" not in result.stdout.partition("---")[0]
    page = next(report.glob("*.html")).read_text()
    assert "cogging" in page


@pytest.mark.usefixtures("known")
def test_a_strangers_configuration_cannot_move_the_terminal_that_shows_its_change(log, tmp_path):
    config, sly = tmp_path / "machine.yaml", "turned \u202e round"
    text = load("published_gantry").source.read_text()
    assert "    model:\n" in text
    config.write_text(text.replace("    model:\n", f"    model:  # {sly}\n"))
    out = tmp_path / "new.yaml"
    shown = run(refine, log, "--config", config, "--out", out, "--axis", "y").stdout
    assert sly in out.read_text()  # the file is as it was written
    assert r"turned \u202e round" in shown
    assert sly not in shown


@pytest.mark.slow
@pytest.mark.usefixtures("known")
def test_a_configuration_may_be_refined_in_place(log, tmp_path):
    config = tmp_path / "machine.yaml"
    config.write_text(load("published_gantry").source.read_text())
    run(refine, log, "--config", config, "--out", config)
    assert "cogging" in load(config).axes["x"].model.names
    assert [path.name for path in tmp_path.iterdir()] == ["machine.yaml"]


def test_a_recording_of_another_machine_leaves_nothing_behind(log, tmp_path):
    with pytest.raises(DataError, match="not a recording of the machine"):
        run(refine, log, "--config", "small_stage", "--out", tmp_path / "new.yaml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("out", "message"), [("nowhere/new.yaml", "no folder"), ("new.parquet", "yaml file")]
)
def test_where_it_goes_is_checked_before_the_work(log, tmp_path, out, message):
    with pytest.raises(UsageError, match=message):
        run(refine, log, "--config", "published_gantry", "--out", tmp_path / out)


def test_a_run_of_no_length_is_refused(tmp_path):
    with pytest.raises(UsageError, match="duration"):
        run(close_loop, "small_stage", "--out", tmp_path / "o", "--duration", "0.5")
