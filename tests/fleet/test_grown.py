"""Where a fit leaves more than before, logs before and after tell what grew, and by which name."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from fleet_findings import BEGAN, head, keep, parameter
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import DataError
from motorctl.fleet.findings import table_of_log
from motorctl.fleet.grown import MOST_ALARMS, what_grew
from motorctl.fleet.head import identity_of
from motorctl.fleet.series import Seen
from motorctl.fleet.store import open_store
from motorctl_benchmarks.fleet.fleet_logs import write_log
from motorctl_benchmarks.fleet.fleet_machines import SOUND, axis_on, draw_fleet, run_log

DAYS = 20
Logs = Callable[..., list[Seen]]


@pytest.fixture
def logs(tmp_path: Path) -> Logs:
    """Return three logs of a machine that changes in a way, by how much of that is there."""

    def made(
        kind: str, grown: float, first: int = 0, seed: int = 31, **changed: float
    ) -> list[Seen]:
        machine = next(each for each in draw_fleet(12, DAYS, seed) if each.kind == kind)
        whole = axis_on(machine, float(DAYS), 0.0, 0.0, DAYS)
        sound = axis_on(machine, 0.0, 0.0, 0.0, DAYS)
        both = zip(sound, whole, strict=True)
        axis = type(whole)(*((1 - grown) * a + grown * b for a, b in both))._replace(**changed)
        found = []
        for number in range(first, first + 3):
            path = tmp_path / f"{kind}-{grown:g}-{number}.parquet"
            write_log(path, machine, number / 3.0, run_log(machine, number, axis))
            found.append(Seen(str(path), identity_of(str(path))))
        return found

    return made


@pytest.mark.parametrize(
    ("kind", "name", "pitch_m"),
    [
        ("encoder dirty", "encoder_error", 0.001),
        pytest.param("bearing damaged", "cogging", 0.0113, marks=pytest.mark.slow),
    ],
)
def test_a_wave_that_grew_is_told_by_its_name_and_its_pitch(
    logs: Logs, kind: str, name: str, pitch_m: float
) -> None:
    grown = what_grew(logs(kind, 0.0), logs(kind, 0.4, 30), "x")
    assert grown is not None
    assert grown.name == name
    assert grown.pitch == pytest.approx(pitch_m, rel=0.002)
    assert grown.explained > 0.8
    assert grown.after_rms > 3.0 * grown.before_rms


@pytest.mark.slow
def test_a_wave_that_was_there_before_is_not_what_grew(logs: Logs) -> None:
    marked = {"mark": 0.05}  # a second pitch that the model lacks, on both sides
    assert what_grew(logs(SOUND, 0.0, **marked), logs(SOUND, 0.0, 30, **marked), "x") is None


@pytest.mark.parametrize(
    "kind",
    [
        SOUND,
        pytest.param("amplifier lags", marks=pytest.mark.slow),
        pytest.param("grease hardens", marks=pytest.mark.slow),
    ],
)
def test_what_is_no_wave_is_not_called_one(logs: Logs, kind: str) -> None:
    assert what_grew(logs(kind, 0.0, seed=33), logs(kind, 1.0, 30, seed=33), "x") is None


def test_a_log_that_became_another_one_is_not_taken_for_it(logs: Logs) -> None:
    before, other, _ = logs(SOUND, 0.0)
    with pytest.raises(DataError, match="is another log by now"):
        what_grew([before], [replace(other, source=before.source)], "x")


@pytest.mark.slow
def test_changes_and_the_page_name_what_grew_or_say_why_not(logs: Logs, tmp_path: Path) -> None:
    before, after = logs("encoder dirty", 0.0), logs("encoder dirty", 0.7, 30)
    rng = np.random.default_rng(5)
    kept = []
    for k in range(40):
        seen = (*before, *after)[k - 17] if 17 <= k < 23 else replace(after[0], log_id=f"{k}")
        for machine, there in (("dirty", True), ("gone", False)):
            told = head(
                machine, seen.log_id if there else f"gone-{k}", BEGAN + k * timedelta(hours=8)
            )
            told = replace(told, source=seen.source if there else f"{tmp_path}/gone.parquet")
            rms = 0.004 + 0.0001 * rng.standard_normal() + (0.003 if k >= 20 else 0.0)
            rows = [parameter(rms, name="residual_rms")]
            kept.append(table_of_log(told, f"{machine}-{k}", rows))
    store = open_store(tmp_path / "store", create=True)
    keep(store, "all", kept)
    words = ["fleet", "changes", "--store", str(store.folder)]
    told = json.loads(CliRunner().invoke(make_app(), [*words, "--logs", "--json"]).stdout)["alarms"]
    alarms = {alarm["machine"]: alarm for alarm in told}
    assert alarms["dirty"]["grown"]["name"] == "encoder_error"
    assert alarms["dirty"]["grown"]["pitch"] == pytest.approx(0.001, rel=0.002)
    assert "gone.parquet" in alarms["gone"]["not_named"]
    shown = CliRunner().invoke(make_app(), [*words, "--logs"]).stdout
    assert "dirty x residual_rms: what grew is encoder_error that repeats every 0.001 m" in shown
    page = tmp_path / "fleet.html"
    report = ["fleet", "report", str(store.folder), "--out", str(page), "--logs"]
    assert CliRunner().invoke(make_app(), report).exit_code == 0
    assert "What grew is encoder_error that repeats every 0.001 m" in page.read_text()


def test_logs_are_read_when_asked_and_of_the_first_twenty_alone(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    kept = []
    for k in range(24):
        for machine in range(MOST_ALARMS + 2):
            told = head(f"{machine}", f"gone-{machine}-{k}", BEGAN + k * timedelta(hours=8))
            told = replace(told, source=f"{tmp_path}/gone.parquet")
            rms = 0.004 + 0.0001 * rng.standard_normal() + (0.003 if k >= 12 else 0.0)
            rows = [parameter(rms, name="residual_rms")]
            kept.append(table_of_log(told, f"{machine}-{k}", rows))
    store = open_store(tmp_path / "store", create=True)
    keep(store, "all", kept)
    words = ["fleet", "changes", "--store", str(store.folder), "--json"]
    silent = CliRunner().invoke(make_app(), words)
    alarms = json.loads(silent.stdout)["alarms"]
    assert len(alarms) == MOST_ALARMS + 2
    assert not [alarm for alarm in alarms if alarm.keys() & {"grown", "not_named"}]
    asked = CliRunner().invoke(make_app(), [*words, "--logs"])
    said = [alarm["not_named"] for alarm in json.loads(asked.stdout)["alarms"]]
    assert sum("gone.parquet" in each for each in said) == MOST_ALARMS
    assert all("its logs were not read" in each for each in said[MOST_ALARMS:])
    assert asked.stderr.count("reading logs of") == MOST_ALARMS
    assert not silent.stderr
