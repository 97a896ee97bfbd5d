"""A machine that is unlike its siblings is told, and hardly one of those that are alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fleet_findings import FRICTION, fleet_store

from motorctl.fleet.change import Level
from motorctl.fleet.changes import changes_in
from motorctl.fleet.head import SIMULATED
from motorctl.fleet.series import Seen, Series
from motorctl.fleet.siblings import FEWEST_SIBLINGS, standings


def fleet(values: np.ndarray, names: list[str] | None = None) -> list[Series]:
    names = names or [f"m{k}" for k in range(len(values))]
    return [
        Series(name, "x", "p", FRICTION, "V", np.zeros(1), np.array([v]), (Seen("log", "id"),))
        for name, v in zip(names, values, strict=True)
    ]


def levels(values: np.ndarray, error: float) -> list[Level]:
    return [Level(float(v), error, 9) for v in values]


def test_a_machine_that_was_always_odd_is_told_with_its_distance(tmp_path: Path) -> None:
    machines = [f"m{k}" for k in range(30)]
    store = fleet_store(
        tmp_path / "store",
        machines=machines,
        days=4,
        moved=lambda machine, axis, name, day: 30.0 * (machine == "m7"),
    )
    found = changes_in(store)
    assert not found.alarms
    (one,) = found.unlike
    assert one.judged.series.machine == "m7"
    assert one.standing.others == 29
    assert one.standing.z == pytest.approx(30.0 * 0.003 / one.standing.spread, rel=0.2)
    assert one.to_dict()["siblings"]["z_error"] > 1.0


@pytest.mark.parametrize("error", [0.1, 2.0])
def test_of_machines_that_are_alike_no_more_are_told_than_is_stated(error: float) -> None:
    level, machines, fleets, told = 0.01, 20, 50, 0
    for seed in range(fleets):
        rng = np.random.default_rng(seed)
        values = rng.standard_normal(machines) + error * rng.standard_normal(machines)
        for found in standings(fleet(values), levels(values, error)):
            assert found is not None
            told += found.p_value <= level
    expected = level * machines * fleets
    assert told <= expected + 3.0 * np.sqrt(expected)


def test_a_level_that_is_vaguer_than_the_others_is_doubted() -> None:
    values = np.append(np.random.default_rng(2).standard_normal(20), 12.0)
    sure, vague = (
        standings(fleet(values), [*levels(values[:-1], 0.1), Level(12.0, error, 9)])[-1]
        for error in (0.1, 6.0)
    )
    assert sure is not None
    assert vague is not None
    assert sure.p_value < 1e-4 < 0.01 < vague.p_value
    assert vague.z_error > sure.z_error


def test_small_fleets_and_simulations_are_not_compared() -> None:
    few = np.arange(float(FEWEST_SIBLINGS))
    assert not any(standings(fleet(few), levels(few, 0.1)))
    names = [f"m{k}" for k in range(FEWEST_SIBLINGS)] + ["m0" + SIMULATED]
    values = np.arange(float(len(names)))
    assert not any(standings(fleet(values, names), levels(values, 0.1)))
    assert all(standings(fleet(values), levels(values, 0.1)))
