"""`motorctl response` in virtual time and from a log: what it tells, and what it refuses."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.cli import response as command
from motorctl.config.shipped import locate
from motorctl.errors import DataError, MotorctlError, RunError, UsageError
from motorctl.log.sample import SampleFlag

pytestmark = pytest.mark.slow

QUICK = ("--band", "40,400", "--periods", "40")
TEXT = locate("published_gantry").read_text(encoding="utf-8")


def run(*words: object) -> Any:
    result = CliRunner().invoke(make_app(), [str(word) for word in ("response", *words)])
    if isinstance(result.exception, MotorctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result


def with_limits(folder: Path, before: str, after: str) -> Path:
    assert before in TEXT
    path = folder / "changed.yaml"
    path.write_text(TEXT.replace(before, after, 1), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str, Path]:
    out = tmp_path_factory.mktemp("response")
    result = run("x", "--config", "published_gantry", *QUICK, "--out", out, "--json")
    return json.loads(result.stdout), result.stderr, out


def test_what_will_be_done_is_told_before_it_is(told):
    first, *_ = told[1].splitlines()
    assert "1 V (10.0% of max_voltage_v) from 40 to 400 Hz" in first
    assert "shaken by" in first
    assert "moves to and fro between 0 and 0.4 m" in first
    assert "in virtual time" in first


def test_curves_margins_and_plant_stand_in_one_document(told):
    document, _, out = told
    assert document["axis"] == "x"
    lines = len(document["frequency_hz"])
    assert lines > 8
    for name in ("plant_m_v", "sensitivity", "complementary_sensitivity", "loop"):
        assert len(document[name]["size"]) == len(document[name]["phase_deg"]) == lines
    assert len(document["coherence"]) == lines
    assert document["margins"]["phase_margin_deg"] == pytest.approx(44.0, abs=1.5)
    # The configured model knows neither lag nor delay.
    assert document["model_margins"]["phase_margin_deg"] > 55.0
    fitted = document["fitted"]["parameters"]
    assert fitted["theta1_v_s2_m"]["value"] == pytest.approx(0.199, rel=0.02)
    assert json.loads((out / "response_x.json").read_text()) == {
        key: value for key, value in document.items() if key != "files"
    }


def test_picture_document_and_log_are_kept_where_they_were_asked_for(told):
    document, _, out = told
    names = ["response_x.png", "response_x.json", "response_x.parquet"]
    assert document["files"] == [str(out / name) for name in names]
    assert (out / names[0]).read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in out.iterdir()) == sorted(names)


def test_the_log_alone_tells_the_same(told):
    document, _, out = told
    again = json.loads(run("x", "--recording", out / "response_x.parquet", "--json").stdout)
    assert again["plant_m_v"] == document["plant_m_v"]
    assert again["margins"] == document["margins"]


def test_without_json_there_is_a_table_and_what_was_found(told):
    printed = " ".join(run("x", "--recording", told[2] / "response_x.parquet").stdout.split())
    assert "phase margin" in printed
    assert re.search(r"plant fitted to it: inertia 0\.(19|20)\d* ± ", printed)
    assert "no part of the mass rings" in printed


def test_two_runs_tell_the_same(told, tmp_path):
    document, _, _ = told
    run("x", "--config", "published_gantry", *QUICK, "--out", tmp_path)
    again = json.loads((tmp_path / "response_x.json").read_text())
    assert again["plant_m_v"] == document["plant_m_v"]


@pytest.mark.parametrize(
    ("words", "told_words"),
    [
        (("w", "--config", "published_gantry"), "no axis 'w'; it has: x, y"),
        (("x", "--config", "published_gantry", "--band", "40"), "should be two frequencies in Hz"),
        (("x", "--config", "published_gantry", "--band", "90,40"), "should be two frequencies"),
        (("x", "--config", "published_gantry", "--band", "40,2600"), "below 2500 Hz"),
        (
            ("x", "--config", "published_gantry", "--band", "40,41"),
            r"has \d lines, 0.61 Hz apart; needs 8",
        ),
        (("x", "--config", "published_gantry", "--amplitude", "2.1"), "2.1 V: limit 2 V"),
        (("x", "--config", "published_gantry", "--amplitude", "0"), "should be above 0"),
        (("x", "--config", "published_gantry", "--amplitude", "nan"), "limit 2 V"),
        (
            ("x", "--config", "published_gantry", "--socket", "s"),
            "--config and --socket: name one of them",
        ),
        (("x", "--config", "can_gantry"), "does not support virtual time"),
        (
            ("x", "--config", "small_stage", "--band", "2,400"),
            "needs 1.3 in a stroke; ask for a --band that begins higher",
        ),
    ],
)
def test_what_cannot_work_is_refused_before_anything_moves(words, told_words):
    with pytest.raises(UsageError, match=told_words):
        run(*words)


def test_an_axis_whose_configuration_allows_no_excitation_is_left_alone(tmp_path):
    none = with_limits(tmp_path, "max_voltage_v: 10 ", "max_excitation_share: 0\n"
                       "      max_voltage_v: 10 ")  # fmt: skip
    with pytest.raises(UsageError, match="max_excitation_share is 0"):
        run("x", "--config", none)


def test_what_would_shake_the_axis_out_of_its_window_is_refused_with_what_would_not(tmp_path):
    narrow = with_limits(tmp_path, "{minimum_m: 0.001,", "{minimum_m: 2.0e-5,")
    with pytest.raises(UsageError, match=r"limit 10 µm, 50% of .*: ask for --amplitude 0\.\d+"):
        run("x", "--config", narrow)


def test_an_axis_that_trips_meanwhile_ends_it_and_its_log_is_kept(tmp_path):
    fault = "seed: 1, faults: [{kind: amplifier_fault, channel: 0, at_s: 1.5}]}"
    faulty = with_limits(tmp_path, "seed: 1}", fault)
    with pytest.raises(RunError, match=r"axis x tripped \(amplifier\)"):
        run("x", "--config", faulty, "--out", tmp_path)
    assert pq.read_table(tmp_path / "response_x.parquet").num_rows > 7000


def test_a_faint_excitation_is_refused_with_the_band_and_the_amplitude_that_would_do(tmp_path):
    words = ("x", "--config", "published_gantry", "--band", "200,600", "--periods", "30")
    with pytest.raises(DataError) as refused:
        run(*words, "--amplitude", "0.01")
    said = str(refused.value)
    assert "lines from 205 to 5" in said
    assert "coherence of 0.9" in said
    assert "--amplitude" in said
    assert "limit 2 V" in said


def changed(log: Path, path: Path, name: str, values: Any) -> Path:
    table = pq.read_table(log)
    at = table.column_names.index(name)
    pq.write_table(table.set_column(at, name, pa.array(values(table.column(at).to_numpy()))), path)
    return path


def test_a_log_without_an_excitation_is_refused(told, tmp_path):
    log = told[2] / "response_x.parquet"
    with pytest.raises(DataError, match="axis y: it was not excited: record it with `motorctl re"):
        run("y", "--recording", log)
    quiet = changed(log, tmp_path / "q.parquet", "x.excitation_v", np.zeros_like)
    with pytest.raises(DataError, match="axis x: it was not excited"):
        run("x", "--recording", quiet)


def test_an_excitation_that_does_not_repeat_is_refused(told, tmp_path):
    def noise(values: Any) -> Any:
        return np.where(values, np.random.default_rng(1).normal(size=len(values)), 0.0)

    log = changed(told[2] / "response_x.parquet", tmp_path / "n.parquet", "x.excitation_v", noise)
    with pytest.raises(DataError, match="does not repeat"):
        run("x", "--recording", log)


def test_of_two_excitations_in_one_log_the_longer_one_is_read(told, tmp_path):
    def twice(values: Any) -> Any:
        between = values.copy()
        between[len(values) * 7 // 10 : len(values) * 9 // 10] = 0.0
        return between

    log = changed(told[2] / "response_x.parquet", tmp_path / "t.parquet", "x.excitation_v", twice)
    again = json.loads(run("x", "--recording", log, "--json").stdout)
    assert all(np.isfinite(again["coherence"]))
    assert np.median(again["coherence"]) > 0.9


@pytest.mark.parametrize(
    ("flag", "why"),
    [
        (SampleFlag.SATURATED, "with the command at its limit were spoiled: .*less amplitude"),
        (SampleFlag.SKIPPED, "where the computer missed a tick were spoiled: .*motorctl latency"),
        (SampleFlag.HELD, "without a sample of the encoder were spoiled: .*the bus"),
    ],
)
def test_spoiled_rows_count_for_nothing_and_the_message_says_what_spoiled_them(
    told, tmp_path, flag, why
):
    log = told[2] / "response_x.parquet"
    spoiled = changed(log, tmp_path / "s.parquet", "x.flags", lambda flags: flags | np.uint32(flag))
    with pytest.raises(
        DataError, match=f"only 0 windows of a whole period .* excited rows .*{why}"
    ):
        run("x", "--recording", spoiled)


def test_a_foreign_recording_does_not_tell_the_loop(told, tmp_path):
    foreign = tmp_path / "foreign.parquet"
    table = pq.read_table(told[2] / "response_x.parquet").replace_schema_metadata(None)
    pq.write_table(table, foreign)
    with pytest.raises(UsageError, match="needs a log that motorctl wrote"):
        run("x", "--recording", foreign)


def test_a_machine_of_metal_needs_a_person_whatever_was_typed():
    with pytest.raises(UsageError, match="--yes does not do, a person at its side has to say yes"):
        command._insist_on_consent("x", ["it goes too far"], yes=True)
    command._insist_on_consent("x", [], yes=True)


def test_where_nobody_is_asked_nothing_moves(monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    for beyond in ([], ["it goes too far"]):
        with pytest.raises(UsageError, match="nobody is there to say yes"):
            command._insist_on_consent("x", beyond, yes=False)


class Terminal:
    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        raise OSError("none of the system's")


@pytest.mark.parametrize("answer", [True, False])
def test_a_person_says_yes_or_no(monkeypatch, answer):
    monkeypatch.setattr("sys.stdin", Terminal())
    monkeypatch.setattr(command.typer, "confirm", lambda question, err: answer)
    if answer:
        command._insist_on_consent("x", ["it goes too far"], yes=False)
        return
    with pytest.raises(UsageError, match="nobody said yes"):
        command._insist_on_consent("x", ["it goes too far"], yes=False)


def test_a_response_is_not_put_beside_the_log_of_another_measurement(told, tmp_path):
    other = tmp_path / "response_x.parquet"
    other.write_bytes(b"of another time")
    log = told[2] / "response_x.parquet"
    with pytest.raises(UsageError, match=r"response_x\.parquet is the log of another measurement"):
        run("x", "--recording", log, "--out", tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == [other.name]


def test_a_measurement_that_fails_leaves_nothing_of_an_earlier_one(tmp_path, monkeypatch):
    for name in ("response_x.parquet", "response_x.json", "response_x.png", "response_y.json"):
        (tmp_path / name).write_text("old")

    def tripped(machine, plan, log, progress):
        raise RunError("axis x tripped")

    monkeypatch.setattr("motorctl.response.rigs.record_simulated", tripped)
    with pytest.raises(RunError, match="axis x tripped"):
        run("x", "--config", "published_gantry", *QUICK, "--out", tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["response_y.json"]
