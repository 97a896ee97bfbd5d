"""What grew is not named where logs before and after cannot tell it, and why is said."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fleet_programs import (
    back_and_forth,
    recorded,
    ringing,
    told_otherwise,
    with_rows_behind,
)

from motorctl.errors import DataError
from motorctl.fleet import read_again
from motorctl.fleet.grown import Grown, what_grew
from motorctl.fleet.series import Seen

ONE_SPEED = back_and_forth(0.3)
SPEEDS = back_and_forth(0.15, 0.3, 0.5)
PITCH_M = 0.0113
MARKED = 0.03 * np.sin(2.0 * np.pi * SPEEDS[0][0] / PITCH_M)
"""A force at each place, as of a damaged rolling element."""
GROUP_ROWS = 2000
FINER = 100.0
"""Times, than the encoder of the simulated fleet."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    return recorded(tmp_path_factory.mktemp("before") / "sound.parquet", SPEEDS[0])


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    return recorded(tmp_path_factory.mktemp("after") / "marked.parquet", SPEEDS[0], MARKED)


@pytest.mark.slow
def test_a_load_that_rings_after_each_ramp_of_one_speed_is_no_wave_along_the_way(
    tmp_path: Path,
) -> None:
    goal, ends = ONE_SPEED
    before = recorded(tmp_path / "before.parquet", goal)
    after = recorded(tmp_path / "after.parquet", goal, ringing(ends, 20.0, 0.05, 1.0))
    with pytest.raises(DataError, match="one speed: a wave grew"):
        what_grew([before], [after], "x")


def _grown_or_reason(before: Seen, after: Seen) -> Grown | str | None:
    try:
        return what_grew([before], [after], "x")
    except DataError as error:
        return str(error).split(":")[0]


@pytest.mark.slow
@pytest.mark.parametrize("hz", [20.0, 40.0])
@pytest.mark.parametrize(
    "program", [(0.3, 0.42), (0.3, 0.3, 0.45, 0.45), (0.15, 0.3, 0.5)], ids=str
)
def test_nor_is_it_one_where_the_speeds_differ(
    tmp_path: Path, program: tuple[float, ...], hz: float
) -> None:
    goal, ends = back_and_forth(*program)
    before = recorded(tmp_path / "before.parquet", goal)
    after = recorded(tmp_path / "after.parquet", goal, ringing(ends, hz, 0.05, 1.0))
    assert _grown_or_reason(before, after) in (None, "one speed")


def test_a_trace_of_twice_its_pitch_does_not_make_a_wave_one_of_twice_its_pitch(
    sound: Seen, tmp_path: Path
) -> None:
    trace = 0.004 * np.sin(np.pi * SPEEDS[0][0] / PITCH_M)
    grown = what_grew([sound], [recorded(tmp_path / "a.parquet", SPEEDS[0], MARKED + trace)], "x")
    assert grown is not None
    assert grown.pitch == pytest.approx(PITCH_M, rel=0.01)


def _without_cogging(config: dict[str, Any]) -> None:
    del config["axes"]["x"]["model"]["cogging"]


def _slower(config: dict[str, Any]) -> None:
    config["programs"]["production"]["max_velocity_m_s"] = 0.4


@pytest.mark.parametrize(("change", "what"), [(_without_cogging, "models"), (_slower, "programs")])
def test_logs_that_declare_other_things_are_not_held_beside_each_other(
    sound: Seen, tmp_path: Path, change: Callable[[dict[str, Any]], None], what: str
) -> None:
    other = told_otherwise(recorded(tmp_path / "other.parquet", SPEEDS[0], MARKED), change)
    with pytest.raises(DataError, match=f"declare different {what}"):
        what_grew([sound], [other], "x")


def test_a_program_that_kept_its_name_and_is_another_is_seen_by_its_motion(
    sound: Seen, tmp_path: Path
) -> None:
    other = recorded(tmp_path / "other.parquet", back_and_forth(0.15, 0.3, 0.4)[0])
    with pytest.raises(DataError, match="moved otherwise before than after"):
        what_grew([sound], [other], "x")


def test_a_log_that_is_not_there_leaves_the_others(
    sound: Seen, marked: Seen, tmp_path: Path
) -> None:
    gone = Seen(str(tmp_path / "gone.parquet"), "gone")
    grown = what_grew([gone, sound], [marked, gone], "x")
    assert grown is not None
    assert grown.pitch == pytest.approx(PITCH_M, rel=0.01)
    with pytest.raises(DataError, match=r"gone\.parquet"):
        what_grew([sound], [gone], "x")


@pytest.mark.slow
@pytest.mark.parametrize("moving", [False, True], ids=["rest", "more than a window"])
def test_rest_in_a_window_is_not_read_nor_more_than_a_window_has(
    sound: Seen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moving: bool
) -> None:
    log = recorded(tmp_path / "rests.parquet", SPEEDS[0], MARKED)
    if moving:
        monkeypatch.setattr(read_again, "MOST_ROWS", SPEEDS[0].shape[1])
    longer = with_rows_behind(log, 10 * GROUP_ROWS, GROUP_ROWS, moving=moving)
    assert what_grew([sound], [longer], "x") is not None


@pytest.mark.slow
def test_an_axis_that_creeps_most_of_the_time_takes_no_more_memory(tmp_path: Path) -> None:
    goal = SPEEDS[0].copy()
    creeping = slice(goal.shape[1] // 2, None)
    goal[:, creeping] = 0.0
    goal[1, creeping] = 1e-6
    goal[0, creeping] = goal[0, creeping.start - 1] + 1e-6 * np.arange(goal.shape[1] // 2) / 5000.0

    def frictionless(config: dict[str, Any]) -> None:
        del config["axes"]["x"]["model"]["coulomb_friction"]
        config["axes"]["x"]["encoder"]["resolution_m"] /= FINER

    before, after = (
        told_otherwise(recorded(tmp_path / f"{name}.parquet", goal, force, FINER), frictionless)
        for name, force in (("a", 0.0), ("b", MARKED))
    )
    tracemalloc.start()
    try:
        _grown_or_reason(before, after)
        assert tracemalloc.get_traced_memory()[1] < 300e6
    finally:
        tracemalloc.stop()
