"""A change in a series is found where it is, with its errors, and none is found in noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from motorctl.fleet.change import FEWEST_POINTS, change_in, scatter_of
from motorctl.fleet.changes import LEAST_SIZE, judged
from motorctl.fleet.series import Seen, Series


def noise(points: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(points)


@given(st.integers(0, 10**6), st.integers(20, 160), st.floats(8.0, 50.0), st.booleans())
def test_a_step_is_told_with_its_place_and_both_levels(
    seed: int, place: int, size: float, down: bool
) -> None:
    value = 100.0 + noise(180, seed)
    value[place:] += -size if down else size

    found = change_in(value)

    assert found is not None
    assert found.form == "step"
    assert abs(found.first - place) <= 1
    assert found.before.value == pytest.approx(100.0, abs=5.0 * found.before.std_error)
    moved = found.after.value - found.before.value
    assert moved == pytest.approx(-size if down else size, abs=1.5)
    assert found.p_value < 1e-5


def test_a_step_of_five_times_the_scatter_is_seen_after_two_days_of_three_points() -> None:
    seen = 0
    for seed in range(40):
        value = noise(180, seed)
        value[174:] += 6.0
        found = change_in(value)
        seen += found is not None and found.first == 174 and found.p_value < 0.0027 / 800
    assert seen >= 34


def alike(points: int, correlated: float, seed: int) -> np.ndarray:
    """Return noise whose neighbours are correlated."""
    fresh = math.sqrt(1.0 - correlated**2) * noise(points + 100, seed)
    return np.asarray(lfilter([1.0], [1.0, -correlated], fresh))[100:]


def test_a_large_step_of_a_young_machine_is_told_within_two_days_though_neighbours_are_alike() -> (
    None
):
    seen = 0
    for seed in range(30):
        value = alike(32, 0.5, seed)
        value[-4:] += 15.0  # a third of a friction that is known to two per cent
        found = change_in(value)
        seen += found is not None and found.first == 28 and found.p_value < 0.0027 / 200
    assert seen >= 28


@pytest.mark.parametrize("correlated", [0.3, 0.6])
def test_of_series_whose_neighbours_are_alike_no_more_are_told_than_is_stated(
    correlated: float,
) -> None:
    level, series = 0.01, 300
    told = sum(
        found is not None and found.p_value <= level and found.size >= LEAST_SIZE
        for found in (change_in(alike(30, correlated, 10**6 + k)) for k in range(series))
    )
    assert told <= level * series + 3.0 * math.sqrt(level * series)


def test_a_slow_drift_is_told_as_one_and_not_as_steps() -> None:
    found = change_in(noise(180, 3) + np.linspace(0.0, 12.0, 180))

    assert found is not None
    assert found.form == "drift"
    assert found.after.value - found.before.value == pytest.approx(12.0, abs=1.5)


@pytest.mark.parametrize(
    "value",
    [np.ones(50), np.zeros(50), noise(FEWEST_POINTS - 1, 0)],
    ids=["constant", "zero", "too short"],
)
def test_a_series_that_says_nothing_is_not_judged(value: np.ndarray) -> None:
    assert change_in(value) is None


@given(st.integers(0, 10**6), st.floats(1e-9, 1e9), st.floats(-1e6, 1e6))
def test_units_do_not_matter(seed: int, scale: float, offset: float) -> None:
    value = noise(60, seed)
    value[30:] += 8.0
    plain, other = change_in(value), change_in(scale * (value + np.round(offset)))
    assert plain is not None
    assert other is not None
    assert (other.form, other.first) == (plain.form, plain.first)
    assert other.size == pytest.approx(plain.size, rel=1e-3)


def test_neighbours_that_are_alike_count_for_less() -> None:
    smooth = np.convolve(noise(400, 1), np.ones(4) / 4.0, "valid")
    assert scatter_of(noise(400, 1), [], 0.1)[1] < 1.6
    assert scatter_of(smooth, [], 0.1)[1] > 4.0


def series(k: int, value: np.ndarray) -> Series:
    hours = np.arange(len(value)) * 8.0 * 3600.0
    return Series(
        f"m{k}", "x", "p", "inertia", "V", hours, value, (Seen("log", "id"),) * len(value)
    )


def test_of_fleets_in_which_nothing_changes_hardly_any_has_an_alarm() -> None:
    level, fleets = 0.1, 40
    alarmed = sum(
        bool(judged([series(k, noise(60, 1000 * f + k)) for k in range(15)], level, 1.0).alarms)
        for f in range(fleets)
    )
    assert alarmed <= level * fleets + 3.0 * np.sqrt(level * fleets)


def test_what_wanders_is_not_told_for_having_been_seen_often() -> None:
    small = noise(400, 5)
    small[200:] += 1.5
    found = change_in(small)
    assert found is not None
    assert found.p_value < 1e-6
    assert not judged([series(0, small)], 0.01, 1.0).alarms


def test_the_largest_change_beside_its_scatter_comes_first() -> None:
    values = [noise(60, k) for k in range(12)]
    values[4][40:] += 6.0
    values[7][30:] -= 15.0
    found = judged([series(k, value) for k, value in enumerate(values)], 0.0027, 1.0)
    assert [alarm.series.machine for alarm in found.alarms] == ["m7", "m4"]
    assert found.alarms[0].since[1] == found.alarms[0].series.moment(30)
    assert found.alarms[0].to_dict()["since"][1].startswith("1970-01-11")


def told_in_a_fleet(found: Any) -> bool:
    """Return whether an alarm would be told in a fleet of 800 series."""
    return found is not None and found.p_value <= 0.0027 / 800 and found.size >= LEAST_SIZE


@pytest.mark.parametrize(("outliers", "at_end"), [(1, False), (1, True), (2, False)])
def test_fewer_points_than_a_change_must_last_are_none(outliers: int, at_end: bool) -> None:
    told = 0
    for seed in range(40):
        value = noise(180, seed)
        first = 180 - outliers if at_end else 20 + 3 * seed
        value[first : first + outliers] += 20.0
        told += told_in_a_fleet(change_in(value))
    assert told <= 2


def test_a_drift_that_begins_inside_is_told_with_its_beginning() -> None:
    value = noise(180, 4)
    value[120:] += np.linspace(0.0, 12.0, 60)

    found = change_in(value)

    assert found is not None
    assert found.form == "drift"
    assert found.first == pytest.approx(120, abs=8)
    assert found.before.value == pytest.approx(0.0, abs=4.0 * found.before.std_error)
    assert found.after.value == pytest.approx(12.0, abs=4.0 * found.after.std_error)
    assert told_in_a_fleet(found)
    (alarm,) = judged([series(0, value)], 0.01, 1.0).alarms
    assert alarm.since == (alarm.series.moment(found.first), alarm.series.moment(179))


def test_a_step_of_rounded_values_is_told() -> None:
    value = np.round(0.2 * noise(180, 5))
    value[90:] += 3.0
    found = change_in(value)
    assert found is not None
    assert (found.form, found.first) == ("step", 90)
    assert told_in_a_fleet(found)


def test_rounded_values_in_which_nothing_changes_are_told_as_none() -> None:
    assert not any(told_in_a_fleet(change_in(np.round(0.2 * noise(180, k)))) for k in range(40))


@pytest.mark.parametrize("bound", [-1.5, -1.0, -0.5, 0.0])
def test_what_leaves_its_bound_now_and_then_is_told_as_no_change(bound: float) -> None:
    told = sum(
        told_in_a_fleet(change_in(np.maximum(0.0, bound + noise(180, 7000 + k))))
        for k in range(300)
    )
    assert told <= 1


def test_what_leaves_its_bound_for_good_is_told_with_its_place() -> None:
    value = np.maximum(0.0, noise(180, 8) - 1.5)
    value[120:] += 6.0
    found = change_in(value)
    assert found is not None
    assert (found.form, found.first) == ("step", 120)
    assert told_in_a_fleet(found)


@pytest.mark.parametrize("seed", range(3))
def test_what_leaves_its_bound_slowly_is_told_too(seed: int) -> None:
    value = np.maximum(0.0, 0.3 * noise(180, seed) - 0.5)
    value[90:] += np.linspace(0.0, 6.0, 90)
    found = change_in(value)
    assert found is not None
    assert found.form == "step"
    assert 90 <= found.first < 150
    assert told_in_a_fleet(found)


@given(st.integers(0, 10**6), st.integers(FEWEST_POINTS, 200), st.floats(0.4, 1.0), st.booleans())
def test_whatever_stands_at_one_value_for_a_large_part_is_judged_without_a_fuss(
    seed: int, points: int, share: float, rising: bool
) -> None:
    rng = np.random.default_rng(seed)
    value = np.where(rng.random(points) < share, 0.0, rng.exponential(1.0, points))
    value += np.where(np.arange(points) >= points // 2, float(rising), 0.0)
    found = change_in(value)
    assert found is None or (0.0 <= found.p_value <= 1.0 and found.scatter > 0.0)


def test_a_series_as_short_as_is_judged_has_no_room_for_a_drift_that_begins_inside() -> None:
    for points in range(FEWEST_POINTS, FEWEST_POINTS + 4):
        assert change_in(noise(points, points)) is not None
