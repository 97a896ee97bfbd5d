"""`motorctl tune` on the simulated gantry: tried out before it is written, or refused."""

import dataclasses
import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.config.shipped import locate
from motorctl.errors import DataError, MotorctlError, RunError, UsageError
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl.tune import tuning
from motorctl.tune.recorded_loop import recorded_loop

pytestmark = pytest.mark.slow

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


def test_gains_that_were_tuned_before_can_be_tuned_again(tmp_path):
    path = tmp_path / "tuned.yaml"
    gains = "gains: {k1_1_s: 366.9, ks_v_s_m: 230.3, gamma_d: 315.1,"
    assert "gains: {k1_1_s: 250, ks_v_s_m: 95, gamma_d: 500," in TEXT
    path.write_text(TEXT.replace("gains: {k1_1_s: 250, ks_v_s_m: 95, gamma_d: 500,", gains))
    tuning.require_tunable(load(path), "x", tmp_path / "out.yaml")


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


@pytest.mark.slow
@pytest.mark.parametrize("why", ["trips", "more error"])
def test_gains_that_trip_or_make_it_worse_are_not_written(config, log, tmp_path, monkeypatch, why):
    runs = []

    def recorded(machine, axis, into, progress):
        runs.append(axis)
        if len(runs) == 2 and why == "trips":
            raise RunError("axis y tripped (following_error): 1.2 mm")
        return dataclasses.replace(read_recording(log, gaps="keep"), source="a simulated run")

    def same_loop_later(recording, machine, axis, **known):
        loop = recorded_loop(recording, load(config), axis)
        return loop if len(runs) < 2 else dataclasses.replace(loop, error=1.01 * loop.error)

    monkeypatch.setattr(tuning, "record_program", recorded)
    monkeypatch.setattr(tuning, "recorded_loop", same_loop_later)
    out = tmp_path / "tuned.yaml"
    out.write_text("mine", encoding="utf-8")
    with pytest.raises(RunError, match="tripped" if why == "trips" else "so nothing was written"):
        run("y", "--config", config, "--out", out, "--force", "--margin", "20deg,3dB")
    assert len(runs) == 2
    assert out.read_text(encoding="utf-8") == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["tuned.yaml"]


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
    with pytest.raises(UsageError, match="was recorded with another loop"):
        run("y", "--config", other, "--recording", log, "--out", tmp_path / "t.yaml")


def test_a_log_of_another_motion_is_refused_and_of_more_repetitions_is_not(config, log, tmp_path):
    slower = tmp_path / "slower.yaml"
    slower.write_text(SHORT.replace("max_velocity_m_s: 0.95", "max_velocity_m_s: 0.9"))
    with pytest.raises(UsageError, match=r"program: .*max_velocity_m_s: 0\.95.*: 0\.9"):
        run("y", "--config", slower, "--recording", log, "--out", tmp_path / "t.yaml")
    longer = tmp_path / "longer.yaml"
    longer.write_text(TEXT)
    assert recorded_loop(read_recording(log), load(longer), "y").counted


def test_a_foreign_recording_is_refused_for_it_does_not_tell_the_gains(config, log, tmp_path):
    table = pq.read_table(log)
    foreign = tmp_path / "foreign.parquet"
    pq.write_table(table.replace_schema_metadata(None), foreign)
    with pytest.raises(UsageError, match="needs a log that motorctl wrote"):
        run("y", "--config", config, "--recording", foreign, "--out", tmp_path / "t.yaml")


def test_gains_that_axes_share_are_refused_and_nothing_is_written(config, log, tmp_path):
    lines = SHORT.splitlines(keepends=True)
    at = [k for k, line in enumerate(lines) if line.startswith("    gains:")]
    lines[at[0]] = lines[at[0]].replace("gains: ", "gains: &g ")
    lines[at[1]] = "    gains: *g\n"
    shared = tmp_path / "shared.yaml"
    shared.write_text("".join(lines), encoding="utf-8")
    for axis in "xy":
        with pytest.raises(UsageError, match="cannot be changed in place"):
            run(axis, "--config", shared, "--recording", log, "--out", tmp_path / "t.yaml")
    assert [path.name for path in tmp_path.iterdir()] == ["shared.yaml"]


def test_a_log_at_another_rate_is_refused(log, tmp_path):
    slower = tmp_path / "slower.yaml"
    slower.write_text(SHORT.replace("rate_hz: 5000", "rate_hz: 4000"), encoding="utf-8")
    with pytest.raises(UsageError, match=r"period \[s\]: 0.0002, here 0.00025"):
        run("y", "--config", slower, "--recording", log, "--out", tmp_path / "t.yaml")


def changed_log(log, path, change):
    table = pq.read_table(log)
    pq.write_table(change(table), path)
    return path


def test_a_log_that_tripped_is_refused_with_the_time(config, log, tmp_path):
    def trip(table):
        k = table.column_names.index("y.fault")
        fault = table.column(k).to_numpy().copy()
        fault[-2000:] = 1
        return table.set_column(k, "y.fault", pa.array(fault))

    tripped = changed_log(log, tmp_path / "tripped.parquet", trip)
    with pytest.raises(DataError, match="was off, homing or in fault at"):
        run("y", "--config", config, "--recording", tripped, "--out", tmp_path / "t.yaml")


def test_a_log_in_which_the_axis_was_excited_is_refused(config, log, tmp_path):
    def excite(table):
        k = table.column_names.index("y.excitation_v")
        added = table.column(k).to_numpy().copy()
        added[-2000:] = 0.1
        return table.set_column(k, "y.excitation_v", pa.array(added))

    excited = changed_log(log, tmp_path / "excited.parquet", excite)
    with pytest.raises(DataError, match="was excited for a frequency response"):
        run("y", "--config", config, "--recording", excited, "--out", tmp_path / "t.yaml")


def test_a_log_that_lost_rows_in_its_last_periods_is_refused(config, log, tmp_path):
    def lose(table):
        return pa.concat_tables([table.slice(0, len(table) - 9000), table.slice(len(table) - 8900)])

    lossy = changed_log(log, tmp_path / "lossy.parquet", lose)
    with pytest.raises(DataError, match="rows are missing at"):
        run("y", "--config", config, "--recording", lossy, "--out", tmp_path / "t.yaml")


def test_a_machine_without_a_program_has_nothing_to_lower(tmp_path):
    lines = [line for line in SHORT.splitlines() if not line.strip().startswith("program:")]
    still = tmp_path / "still.yaml"
    still.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(UsageError, match="axis y has no program"):
        run("y", "--config", still, "--out", tmp_path / "t.yaml")


@pytest.mark.slow
def test_a_lag_that_the_model_declares_counts_once(tmp_path):
    parts = SHORT.rpartition(
        "      em_cubic: {initial: -0.0003, bounds: [-0.001, 0], covariance: 0.005}\n"
    )
    lagging = tmp_path / "lagging.yaml"
    lag = "      input_lag: {time_s: 490.0e-6}\n"
    lagging.write_text(parts[0] + parts[1] + lag + parts[2], encoding="utf-8")
    log = tmp_path / "lagging.parquet"
    simulate(load(lagging), log)
    loop = recorded_loop(read_recording(log, gaps="keep"), load(lagging), "y")
    assert loop.plant.lag_s == pytest.approx(490e-6)
    assert loop.plant.delay_s + loop.plant.lag_s == pytest.approx(490e-6, abs=250e-6)
