"""Long logs are cut where their motion tells something, and what a window holds is bounded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fit_plant import X_THETA
from fleet_bench import looked_at
from fleet_logs import plant_log
from hypothesis import given
from hypothesis import strategies as st

from motorctl import fit
from motorctl.experiment.information import Products
from motorctl.fleet import job
from motorctl.fleet.findings import Refusal
from motorctl.long_logs.choice import clearest_within, most_left_and_clearest
from motorctl.long_logs.excitation import Excitation
from motorctl.long_logs.windows import LONGEST_SPAN_S, MOST_ROWS, clearest, windows_of

PERIOD_S = 1.0 / 5000.0
GROUP = 1 << 16


def piece(seed: int, rows: int = 3000, size: float = 1.0, noise: float = 0.1) -> Excitation:
    """Return what motion tells that excites two parameters, under noise a tenth of the command."""
    rng = np.random.default_rng(seed)
    psi = size * rng.standard_normal((rows, 2))
    command = psi @ [1.0, 0.5] + noise * size * rng.standard_normal(rows)
    columns = np.column_stack([psi, command])
    return Excitation(Products(columns.T @ columns, rows, ()), 0.004)


def test_rest_is_in_no_window() -> None:
    told = [None, piece(0), None, None, piece(1), None]
    windows = windows_of("x", [GROUP] * 6, told, PERIOD_S)
    assert [window.groups for window in windows] == [(1,), (4,)]


def test_little_motion_is_gathered_until_it_tells_enough() -> None:
    told = [piece(k, rows=300) for k in range(12)]
    windows = windows_of("x", [1000] * 12, told, PERIOD_S)
    assert 1 < len(windows) < 12
    assert all(len(window.groups) > 1 for window in windows[:-1])


def test_motion_that_tells_nothing_makes_no_window() -> None:
    assert not windows_of("x", [GROUP] * 3, [piece(k, rows=20) for k in range(3)], PERIOD_S)
    assert not windows_of("x", [GROUP] * 3, [None] * 3, PERIOD_S)


@given(
    st.lists(st.sampled_from([None, 20, 60, 300, 3000]), min_size=1, max_size=60),
    st.sampled_from([1 << 12, GROUP, 1 << 18]),
)
def test_windows_hold_bounded_rows_and_time_and_none_twice(
    rows: list[int | None], group_rows: int
) -> None:
    told = [None if count is None else piece(k, count) for k, count in enumerate(rows)]
    windows = windows_of("x", [group_rows] * len(told), told, PERIOD_S)
    taken = [group for window in windows for group in window.groups]
    assert taken == sorted(set(taken))
    assert not [group for group in taken if told[group] is None]
    assert [window.number for window in windows] == list(range(len(windows)))
    for window in windows:
        assert window.rows <= MOST_ROWS
        span = window.groups[-1] - window.groups[0] + 1
        assert span == 1 or span * group_rows * PERIOD_S <= LONGEST_SPAN_S


def test_the_clearest_windows_are_diagnosed() -> None:
    told = [piece(0, 2000), piece(1, 9000), piece(2, 4000)]
    windows = windows_of("x", [GROUP] * 3, told, PERIOD_S)
    assert clearest(windows, 2) == {1, 2}
    assert clearest(windows, 0) == set()


def test_a_window_in_which_the_model_lacks_something_is_as_clear_as_one_in_which_it_does_not() -> (
    None
):
    told = [piece(0), piece(1), piece(2, noise=1.0), piece(3)]
    windows = windows_of("x", [GROUP] * 4, told, PERIOD_S)
    assert [window.groups for window in windows] == [(0,), (1,), (2,), (3,)]
    clear = [window.clearness for window in windows]
    assert max(clear) - min(clear) < 0.5
    assert max(windows, key=lambda window: window.left_rms).groups == (2,)


def test_of_windows_that_tell_alike_the_next_is_the_furthest_from_those_taken() -> None:
    windows = windows_of("x", [GROUP] * 9, [piece(k) for k in range(9)], PERIOD_S)
    taken = clearest_within(windows, 2 * GROUP, already=[windows[4]])
    assert {window.number for window in taken} == {0, 8}


def test_a_window_that_is_larger_than_its_share_is_read_where_much_more_is_left_in_it() -> None:
    told = [piece(k) for k in range(4)]
    told[2] = piece(2, noise=1.0)
    windows = windows_of("x", [GROUP] * 4, told, PERIOD_S)
    reserved, others = most_left_and_clearest(windows, 2 * GROUP)
    assert [window.number for window in reserved] == [2]
    assert len(others) == 1


@given(st.lists(st.sampled_from([300, 1000, 3000]), min_size=1, max_size=20), st.integers(1, 12))
def test_no_more_rows_are_read_than_are_asked_for_and_no_window_twice(
    rows: list[int], groups: int
) -> None:
    told = [piece(k, count) for k, count in enumerate(rows)]
    windows = windows_of("x", [GROUP] * len(told), told, PERIOD_S)
    if not windows:
        return
    reserved, others = most_left_and_clearest(windows, groups * GROUP)
    numbers = [window.number for window in (*reserved, *others)]
    assert numbers
    assert len(set(numbers)) == len(numbers)
    assert len(numbers) == 1 or sum(w.rows for w in (*reserved, *others)) <= groups * GROUP


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("long")
    return plant_log(
        folder / "long.parquet", theta=X_THETA[:4], duration_s=10.0, repeats=3, rest_s=30.0
    )


@pytest.fixture
def short_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take what is a few minutes for a long log, and scan it in three parts."""
    monkeypatch.setattr(job, "MOST_ROWS", 1 << 17)
    monkeypatch.setattr(job, "SCANNED_ROWS", 1 << 19)


@pytest.mark.usefixtures("short_windows")
def test_each_window_of_a_long_log_gives_the_parameters_of_its_motion(long_log: Path) -> None:
    rows = looked_at(long_log)
    assert not isinstance(rows, Refusal), rows
    inertia = [row for row in rows if row.get("name") == "inertia"]
    assert len(inertia) >= 3
    for row in inertia:
        assert row["value"] == pytest.approx(0.197, rel=0.01)
    begins = [row["begin_utc"] for row in inertia]
    assert begins == sorted(begins)
    assert (begins[-1] - begins[0]).total_seconds() > 75.0


@pytest.mark.usefixtures("short_windows")
def test_a_long_log_without_motion_is_no_fault_and_says_why(good_log: Path, tmp_path: Path) -> None:
    table = pq.read_table(good_log)
    held = table.take(pa.array(np.zeros(200_000, np.int64)))
    ticks = pa.array(np.arange(len(held)))
    held = held.set_column(held.schema.get_field_index("tick"), "tick", ticks)
    times = pa.array(np.arange(len(held)) * PERIOD_S)
    held = held.set_column(held.schema.get_field_index("time_s"), "time_s", times)
    log = tmp_path / "still.parquet"
    pq.write_table(held.replace_schema_metadata(table.schema.metadata), log)
    (row,) = looked_at(log)
    assert row["kind"] == "nothing"
    assert "no motion that tells a parameter" in row["text"]


def test_what_is_kept_of_a_short_log_is_what_fit_tells(good_log: Path) -> None:
    rows = looked_at(good_log)
    assert not isinstance(rows, Refusal), rows
    told = fit(good_log, model="C1").to_dict()["axes"]["x"]
    kept = {row["name"]: row for row in rows}
    for name, parameter in told["parameters"].items():
        assert kept[name]["value"] == parameter["value"]
        assert kept[name]["std_error"] == parameter["std_error"]
        assert kept[name]["unit"] == parameter["unit"]
    assert kept["residual_rms"]["value"] == told["error"]["rms"]
    assert kept["input_delay_s"]["value"] == told["input_delay_s"]["value"]


def test_a_parameter_at_its_bound_is_kept_and_says_so(tmp_path: Path) -> None:
    gone = [*X_THETA[:2], -0.05, *X_THETA[3:]]  # beyond what the model allows
    rows = looked_at(plant_log(tmp_path / "log.parquet", theta=gone, duration_s=4.0, seed=3))
    assert not isinstance(rows, Refusal), rows
    told = {row["name"]: row for row in rows}
    assert {"inertia", "viscous_friction", "coulomb_friction", "offset"} <= set(told)
    assert told["coulomb_friction"]["text"] == "at its lower bound"
    assert told["coulomb_friction"]["std_error"] is None
    assert told["inertia"]["text"] is None
