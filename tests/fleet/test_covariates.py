"""A trend that temperature explains is no alarm; one of its own is told beside it."""

from __future__ import annotations

import json
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from fleet_findings import BEGAN, FRICTION, fleet_store
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import DataError
from motorctl.fleet.change import change_in
from motorctl.fleet.changes import judged
from motorctl.fleet.covariates import Covariates, Readings, read_covariates
from motorctl.fleet.influence import change_beside, influence_on
from motorctl.fleet.series import Seen, Series

POINTS = 180
SENSITIVE, BOTH = "warm", "warm and worn"


def hall(days: np.ndarray | float) -> np.ndarray:
    """Return a temperature: night and day, and a spring."""
    return (
        20.0 + 3.0 * np.sin(2.0 * np.pi * (days - 0.3)) + 8.0 * (1.0 - np.cos(np.pi * days / 60.0))
    )


def moved(machine: str, axis: str, name: str, day: float) -> float:
    away = -0.8 * float(hall(day) - 20.0) if machine in (SENSITIVE, BOTH) else 0.0
    return away + (9.0 if machine == BOTH and day >= 45 else 0.0)


def readings(file: Path, lines: list[str]) -> Path:
    file.write_text("\n".join(["machine,time,temperature_C", *lines]) + "\n")
    return file


@pytest.fixture
def temperature(tmp_path: Path) -> Path:
    hours = range(0, 24 * 60 + 1, 2)
    lines = [f",{(BEGAN + timedelta(hours=h)).isoformat()},{hall(h / 24.0):.2f}" for h in hours]
    return readings(tmp_path / "hall.csv", lines)


def test_a_trend_that_goes_with_temperature_is_no_alarm_and_a_step_beside_it_is(
    tmp_path: Path, temperature: Path
) -> None:
    machines = ["m1", "m2", SENSITIVE, BOTH]
    store = fleet_store(tmp_path / "store", machines=machines, days=60, moved=moved)
    words = ["fleet", "changes", "--store", str(store.folder)]
    asked = [*words, "--covariates", str(temperature), "--json"]
    without = json.loads(CliRunner().invoke(make_app(), [*words, "--json"]).stdout)
    assert {alarm["machine"] for alarm in without["alarms"]} >= {SENSITIVE}

    document = json.loads(CliRunner().invoke(make_app(), asked).stdout)
    (alarm,) = document["alarms"]
    assert (alarm["machine"], alarm["form"]) == (BOTH, "step")
    assert alarm["since"][1] == (BEGAN + timedelta(days=45)).isoformat()
    slope = alarm["influence"]["covariates"]["temperature_C"]
    assert slope["slope"] == pytest.approx(-0.8 * 0.003, abs=4.0 * slope["std_error"])
    told = {each["machine"]: each for each in document["explained"]}
    assert told[SENSITIVE]["certain"]
    left = told[SENSITIVE]["left"]
    assert abs(left["value"]) < 4.0 * left["std_error"]
    shown = CliRunner().invoke(make_app(), asked[:-1]).stdout
    assert f"no alarm: {SENSITIVE} x {FRICTION}" in shown
    assert "goes with temperature_C" in shown


def noise(seed: int, likeness: float = 0.0) -> np.ndarray:
    fresh = np.random.default_rng(seed).standard_normal(POINTS)
    value = fresh.copy()
    for k in range(1, POINTS):
        value[k] = likeness * value[k - 1] + np.sqrt(1.0 - likeness**2) * fresh[k]
    return value


@pytest.mark.parametrize("likeness", [pytest.param(0.0, marks=pytest.mark.slow), 0.5])
@pytest.mark.parametrize("kind", ["days and seasons", "wandering", "a ramp"])
def test_of_series_that_only_follow_a_covariate_no_more_are_told_than_is_stated(
    kind: str, likeness: float
) -> None:
    days, level, told, series = np.arange(POINTS) / 3.0, 0.05, 0, 30
    for seed in range(series):
        beside = {
            "days and seasons": hall(days),
            "wandering": np.cumsum(noise(10**6 + seed)),
            "a ramp": 0.2 * days,
        }[kind]
        found = influence_on(
            0.7 * beside + noise(seed, likeness), (beside - beside.mean())[:, None], ("t",)
        )
        assert found is not None
        change = change_beside(found)
        assert change is not None
        told += change.p_value <= level
    assert told <= level * series + 2.0 * np.sqrt(level * series)


def test_a_drift_that_looks_like_the_covariate_is_neither_told_nor_called_explained(
    tmp_path: Path,
) -> None:
    lines = [f",{(BEGAN + timedelta(days=d)).isoformat()},{20.0 + 0.2 * d}" for d in range(61)]
    file = readings(tmp_path / "ramp.csv", lines)
    store = fleet_store(
        tmp_path / "store", machines=["m1"], days=60, moved=lambda m, a, n, day: day / 6.0
    )
    words = ["fleet", "changes", "--store", str(store.folder), "--covariates", str(file), "--json"]
    document = json.loads(CliRunner().invoke(make_app(), words).stdout)
    assert not document["alarms"]
    (one,) = document["explained"]
    assert not one["certain"]


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.floats(-5.0, 5.0))
def test_slopes_are_found_whatever_the_series_does_beside(seed: int, slope: float) -> None:
    days = np.arange(POINTS) / 3.0
    beside = hall(days)
    value = slope * beside + noise(seed)
    value[100:] += 20.0
    found = influence_on(value, (beside - 20.0)[:, None], ("t",))
    assert found is not None
    assert found.slope[0] == pytest.approx(slope, abs=6.0 * found.std_error[0])
    assert found.std_error[0] < 0.1
    change = change_beside(found)
    assert change is not None
    assert (change.form, change.first) == ("step", 100)


def test_covariates_that_never_vary_change_nothing() -> None:
    value = noise(1)
    assert influence_on(value, np.full((POINTS, 1), 3.0), ("t",)) is None
    assert change_in(value) == change_in(value, np.empty((POINTS, 0)))


def test_readings_of_a_machine_go_before_those_of_all_and_gaps_leave_it_out(
    tmp_path: Path,
) -> None:
    at = [(BEGAN + timedelta(days=d)).isoformat() for d in (0, 1, 2, 10)]
    lines = [f",{at[0]},10", f",{at[1]},20", f"own,{at[0]},1", f"own,{at[2]},3", f"own,{at[3]},4"]
    found = read_covariates(readings(tmp_path / "t.csv", [*lines, f"own,{at[1]},"]))
    start = BEGAN.timestamp()
    days = np.array([0.0, 0.5, 1.0]) * 86400.0 + start
    assert found.beside("another", days)[:, 0] == pytest.approx([10.0, 15.0, 20.0])
    own = found.beside("own", days)[:, 0]
    assert list(np.isnan(own)) == [
        False,
        True,
        False,
    ]  # half a day from one, more than one from the next
    assert found.beside("own", np.array([start + 2.0 * 86400.0]))[0, 0] == 3.0
    assert np.isnan(found.beside("another", days + 3 * 86400.0)).all()


@settings(max_examples=15)
@given(st.integers(0, 158), st.integers(1, 40), st.integers(0, 100))
def test_a_thermometer_that_was_out_for_days_does_not_make_the_weather_an_alarm(
    first: int, missing: int, seed: int
) -> None:
    days = np.arange(POINTS) / 3.0
    value = 0.7 * hall(days) + noise(seed, 0.3)
    out = slice(first, min(first + missing, POINTS - 1))
    readings = {("", "t"): Readings(*np.delete(np.array([days * 86400.0, hall(days)]), out, 1))}
    one = Series("m", "x", "p", FRICTION, "V", days * 86400.0, value, (Seen("a", "b"),) * POINTS)
    found = judged([one], 1e-4, 1.0, Covariates(("t",), readings))
    assert not found.alarms
    (use,) = found.covariates
    assert (use.series, use.not_used, found.without_covariates) == (1, 0, 0)
    assert use.points_left_out <= missing


def test_a_change_that_has_nothing_to_do_with_a_covariate_is_not_said_to_go_with_it() -> None:
    days, told, explained = np.arange(60) / 3.0, 0, 0
    for seed in range(8):
        rng = np.random.default_rng(500 + seed)
        readings = {("", "t"): Readings(days * 86400.0, np.cumsum(rng.standard_normal(60)))}
        fleet = []
        for k in range(12):
            value = rng.standard_normal(60)
            value[54:] += 3.4 * (k < 6)
            seen = (Seen("a", "b"),) * 60
            fleet.append(Series(f"m{k}", f"x{k}", "p", FRICTION, "V", days * 86400.0, value, seen))
        found = judged(fleet, 1.0 / 365.0, 1.0, Covariates(("t",), readings))
        told += len(found.alarms)
        explained += len(found.explained)
        judged_ones = {id(one) for one in found.judged}
        assert all(id(alarm.judged) in judged_ones for alarm in found.alarms)
    assert told > 20
    assert explained <= 0.05 * told


def test_points_of_another_time_are_left_out_and_counted_and_a_dead_thermometer_is_not_used() -> (
    None
):
    days = np.arange(POINTS) / 3.0
    times = 9e8 + days * 86400.0
    early, value = np.append(100.0, times), np.append(0.0, 0.7 * hall(days) + noise(3))
    seen = (Seen("a", "b"),) * len(value)
    one = Series("m", "x", "p", FRICTION, "V", early, value, seen)
    for until, used in ((POINTS, True), (POINTS - 15, False)):
        readings = {("", "t"): Readings(times[:until], hall(days)[:until])}
        found = judged([one], 1e-4, 1.0, Covariates(("t",), readings))
        (use,) = found.covariates
        assert (use.name, use.series, use.points_left_out) == ("t", int(used), int(used))
        assert use.not_used == found.without_covariates == int(not used)
        assert bool(found.alarms) is not used


def test_a_series_without_any_value_is_none_whatever_is_beside() -> None:
    empty = Series("m", "x", "p", FRICTION, "V", np.empty(0), np.empty(0), ())
    readings = {("", "t"): Readings(np.array([0.0]), np.array([20.0]))}
    found = judged([empty], 1e-4, 1.0, Covariates(("t",), readings))
    assert (found.series, found.too_short) == (0, 1)
    assert influence_on(np.empty(0), np.empty((0, 1)), ("t",)) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: its columns are none"),
        ("machine,time\nm,2026-03-01\n", "line 1: its columns are machine, time"),
        ("machine,time,t\nm,yesterday,1\n", "line 2: time is 'yesterday'"),
        ("machine,time,t\nm,2026-03-01,warm\n", "line 2: t is 'warm'"),
        ("machine,time,t\nm,2026-03-01,nan\n", "line 2: t is 'nan'"),
        ("machine,time,t\nm,2026-03-01\n", "line 2: has 2 cells, its heading 3"),
        ("machine,time,t\n", "has no readings"),
        ("machine,time,t,t\n", "each once"),
    ],
)
def test_bad_readings_are_told_with_their_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "t.csv"
    file.write_text(text)
    with pytest.raises(DataError, match=message):
        read_covariates(file)
    with pytest.raises(DataError, match="cannot be read as CSV"):
        read_covariates(tmp_path / "none.csv")
