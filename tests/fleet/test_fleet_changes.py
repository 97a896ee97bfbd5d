"""`motorctl fleet changes` names the machine and the parameter that changed, and since when."""

from __future__ import annotations

import json
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from fit_plant import X_THETA
from fleet_bench import store_of
from fleet_findings import BEGAN, FRICTION, head, keep, kept
from fleet_logs import plant_log
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import UsageError
from motorctl.fleet.changes import changes_in, judged
from motorctl.fleet.findings import Refusal, table_of_refusal
from motorctl.fleet.report import write_fleet_page
from motorctl.fleet.series import Seen, Series, series_of
from motorctl.fleet.store import Store, open_store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Three machines over twenty days of three logs each; the friction of one rises on the 15th."""
    store, rng = open_store(tmp_path / "store", create=True), np.random.default_rng(0)
    logs = []
    for k in range(60):
        for machine in ("m1", "m2", "m3"):
            risen = 0.1 if machine == "m2" and k >= 42 else 0.0
            told = head(machine, f"{machine}-{k}", BEGAN + k * timedelta(hours=8))
            logs.append(kept(told, 0.14 + risen + 0.005 * rng.standard_normal()))
    keep(store, "all", logs)
    return store


def test_the_machine_that_changed_is_told_with_evidence(store: Store) -> None:
    words = ["fleet", "changes", "--store", str(store.folder)]
    document = json.loads(CliRunner().invoke(make_app(), [*words, "--json"]).stdout)
    (alarm,) = document["alarms"]
    assert (alarm["machine"], alarm["axis"], alarm["parameter"]) == ("m2", "x", FRICTION)
    assert alarm["form"] == "step"
    assert alarm["since"] == ["2026-03-14T16:00:00+00:00", "2026-03-15T00:00:00+00:00"]
    assert alarm["before"]["value"] == pytest.approx(0.14, abs=4 * alarm["before"]["std_error"])
    assert alarm["after"]["value"] == pytest.approx(0.24, abs=4 * alarm["after"]["std_error"])
    assert alarm["log"] == "m2/m2-42.parquet"
    assert document["series"] == 3
    assert document["level"] == pytest.approx(1.0 / 365.0)

    shown = CliRunner().invoke(make_app(), words).stdout
    assert "look at first: machine m2, axis x: m2/m2-42.parquet" in shown
    assert "1 of 3 series changed" in shown


def test_values_of_another_model_are_no_change(store: Store) -> None:
    again = [
        head("m1", f"m1-{k}", BEGAN + k * timedelta(hours=8), model_id="another")
        for k in range(40, 60)
    ]
    keep(store, "again", [kept(told, 0.5 + 0.001 * (k % 3)) for k, told in enumerate(again)])
    assert [alarm.series.machine for alarm in changes_in(store).alarms] == ["m2"]
    (m1,) = (series for series in series_of(store) if series.machine == "m1")
    assert len(m1.value) == 20
    assert m1.value.min() >= 0.5
    assert m1.of_other_models == 40


def test_the_model_that_was_fitted_last_counts_though_it_did_not_fit_the_last_log(
    store: Store,
) -> None:
    again = [
        head("m1", f"m1-{k}", BEGAN + k * timedelta(hours=8), model_id="another") for k in range(59)
    ]
    keep(store, "again", [kept(told, 0.5) for told in again])
    (m1,) = (series for series in series_of(store) if series.machine == "m1")
    assert len(m1.value) == 59
    assert changes_in(store).of_other_models == 1
    shown = CliRunner().invoke(make_app(), ["fleet", "changes", "--store", str(store.folder)])
    assert "1 values of other models than the last were left out" in shown.stdout


def test_a_log_that_was_refused_later_counts_no_more(store: Store, tmp_path: Path) -> None:
    logs = [head("m2", f"m2-{k}", BEGAN + k * timedelta(hours=8)) for k in range(42, 60)]
    refused = [Refusal(log.source, f"{log.source}: is of another machine") for log in logs]
    keep(
        store,
        "refused",
        [
            table_of_refusal(why, f"{log.log_id}-r", log.log_id, log)
            for why, log in zip(refused, logs, strict=True)
        ],
    )
    (m2,) = (series for series in series_of(store) if series.machine == "m2")
    assert len(m2.value) == 42
    changes, page = changes_in(store), write_fleet_page(store, tmp_path / "page.html")
    assert not changes.alarms
    assert [page.series, page.alarms] == [changes.series, changes.alarms]


def test_a_point_names_a_log_that_has_its_value(store: Store) -> None:
    values = [0.1, 0.5, 0.51]  # it changed after the first log of the shift
    shift = [
        kept(head("m5", f"m5-{k}", BEGAN + timedelta(hours=k)), v) for k, v in enumerate(values)
    ]
    keep(store, "m5", shift)
    (m5,) = (series for series in series_of(store) if series.machine == "m5")
    assert [seen.source for seen in m5.seen] == ["m5/m5-1.parquet"]


def test_names_that_look_like_markup_are_shown_as_they_are(tmp_path: Path) -> None:
    store = open_store(tmp_path / "marked", create=True)
    name, rng = "[/m]", np.random.default_rng(1)
    logs = [
        kept(
            head(name, f"{k}", BEGAN + k * timedelta(hours=8)),
            float(k >= 30) + 0.01 * rng.standard_normal(),
        )
        for k in range(60)
    ]
    keep(store, "all", logs)
    shown = CliRunner().invoke(make_app(), ["fleet", "changes", "--store", str(store.folder)])
    assert shown.exit_code == 0, shown.output
    assert "[/m] x" in shown.stdout
    assert "[V]" in shown.stdout


def test_windows_of_one_shift_are_one_point_and_vague_ones_none(store: Store) -> None:
    shift = [kept(head("m4", f"m4-{k}", BEGAN + timedelta(hours=k)), float(k)) for k in range(6)]
    vague = head("m4", "m4-vague", BEGAN + timedelta(hours=9))
    keep(store, "m4", [*shift, kept(vague, 1e9, std_error=5.0)])
    (m4,) = (series for series in series_of(store) if series.machine == "m4")
    assert list(m4.value) == [2.5]


def test_machines_that_always_were_unlike_make_no_change_more_probable() -> None:
    rng, machines, points = np.random.default_rng(11), 40, 60
    times = np.arange(points) * 8.0 * 3600.0

    def told(odd: int) -> list[float]:
        series = []
        for k in range(machines):
            value = rng.standard_normal(points) + (1000.0 if k < odd else 0.0)
            if k == machines - 1:
                value[40:] += 2.7  # a change that its own family leaves in doubt
            seen = (Seen("log", "id"),) * points
            series.append(Series(f"m{k}", "x", "p", FRICTION, "V", times, value, seen))
        found = judged(series, 0.999, 1.0)
        assert sum(one.adjusted < 1e-3 for one in found.unlike) == odd
        return [alarm.adjusted for alarm in found.alarms if alarm.series.machine == "m39"]

    state = rng.bit_generator.state
    alone = told(0)
    assert alone[0] < 0.5
    rng.bit_generator.state = state
    assert told(15) == pytest.approx(alone, rel=1e-6)


@pytest.mark.parametrize(("alarms", "looks"), [(0.0, 1.0), (400.0, 1.0), (1.0, 0.0)])
def test_impossible_rates_of_false_alarms_are_refused(
    store: Store, alarms: float, looks: float
) -> None:
    with pytest.raises(UsageError, match="false alarms a year"):
        changes_in(store, false_alarms_a_year=alarms, looks_a_day=looks)


@pytest.mark.slow
def test_friction_that_rises_in_a_simulated_plant_is_found_from_its_logs(tmp_path: Path) -> None:
    usual = X_THETA[:4]
    risen = [*usual]
    risen[2] *= 1.2
    logs = [
        plant_log(
            tmp_path / f"{machine}-{k}.parquet",
            seed=100 * j + k,
            duration_s=4.0,
            theta=risen if machine == "worn" and k >= 10 else usual,
            machine=machine,
            started=BEGAN + timedelta(hours=8 * k),
        )
        for j, machine in enumerate(("sound", "worn"))
        for k in range(14)
    ]
    found = changes_in(store_of(tmp_path / "store", logs))
    assert {alarm.series.machine for alarm in found.alarms} == {"worn"}
    (friction,) = (alarm for alarm in found.alarms if alarm.series.name == FRICTION)
    assert friction.since[1] == BEGAN + timedelta(hours=8 * 10)
    grown = friction.change.after.value / friction.change.before.value
    assert grown == pytest.approx(1.2, rel=0.01)
