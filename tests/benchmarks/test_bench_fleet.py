"""`motorctl bench fleet`: an honest fleet, honest scores, and findings that nothing disturbs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl_benchmarks.fleet.disturbances import (
    differing,
    undisturbed,
    with_killed_scheduler,
    with_killed_workers,
    with_refusing_store,
)
from motorctl_benchmarks.fleet.findings import FleetOptions, fleet_findings, found_of, some_logs
from motorctl_benchmarks.fleet.fleet_machines import (
    KINDS,
    SOUND,
    Machine,
    axis_on,
    draw_fleet,
    log_times,
    run_log,
)
from motorctl_benchmarks.fleet.fleet_nights import Fleet, Nights, Told
from motorctl_benchmarks.fleet.fleet_score import outcome_of
from motorctl_benchmarks.fleet.refusing_store import Door
from motorctl_benchmarks.fleet.same_findings import digests

DAYS = 20
DISTURBED_LOGS = 6


def machine_of(kind: str) -> Machine:
    return next(each for each in draw_fleet(12, DAYS, 1) if each.kind == kind)


def test_a_fleet_is_drawn_from_its_seed_alone_and_has_all_ten_kinds() -> None:
    fleet = draw_fleet(12, DAYS, 7)
    assert fleet == draw_fleet(12, DAYS, 7)
    assert fleet != draw_fleet(12, DAYS, 8)
    assert {each.kind for each in fleet} == {*KINDS, SOUND}
    assert len({each.name for each in draw_fleet(50, DAYS, 7)}) == 50


@pytest.mark.parametrize("kind", [name for name, told in KINDS.items() if told.form != "none"])
def test_a_machine_is_sound_until_its_change_begins_and_then_it_is_not(kind: str) -> None:
    machine = machine_of(kind)
    before, begun, ended = (
        axis_on(machine, day, 0.0, 0.0, DAYS)
        for day in (machine.onset_day - 0.01, machine.onset_day + 0.01, machine.ends_day)
    )
    assert before == machine.axis
    assert ended != before
    assert (begun == ended) == (machine.form == "step")


def test_logs_of_a_machine_never_overlap_and_are_as_many_as_asked() -> None:
    machine = machine_of(SOUND)
    for logs_a_day in (1, 2, 3):
        times = log_times(machine, DAYS, logs_a_day)
        assert len(times) == DAYS * logs_a_day
        assert np.diff(times).min() * 86400.0 > 60.0
        assert list(np.floor(times[::logs_a_day])) == list(range(DAYS))


def test_a_damaged_machine_follows_worse_and_a_log_can_be_made_again() -> None:
    machine = machine_of("bearing damaged")
    sound, worn = (
        run_log(machine, 0, axis_on(machine, day, 0.0, 0.0, DAYS)) for day in (0.0, DAYS)
    )
    assert worn.tracking_m > 1.2 * sound.tracking_m
    again = run_log(machine, 0, axis_on(machine, 0.0, 0.0, 0.0, DAYS))
    assert np.array_equal(again.position_m, sound.position_m)


def nights_of(machine: Machine, told: dict[int, list[Told]], tracking: list[float]) -> Nights:
    nights = [{machine.name: told[night]} if night in told else {} for night in range(DAYS)]
    return Nights(told=nights, tracking_m={machine.name: tracking})


def alarm(parameter: str) -> Told:
    return Told(parameter, "step", 0.0, 9.0, "log", (), ())


def from_night(first: int, *names: str) -> dict[int, list[Told]]:
    return {night: [alarm(name) for name in names] for night in range(first, DAYS)}


def test_a_step_counts_as_found_within_two_days_and_by_its_own_name_alone() -> None:
    machine = machine_of("payload changed")
    fleet, sound = Fleet((machine,), DAYS, 3, 1), [1.0] * DAYS
    first = int(machine.onset_day)
    soon = outcome_of(machine, fleet, nights_of(machine, from_night(first + 1, "inertia"), sound))
    assert (soon.in_time, soon.right, soon.false_alarms) == (True, True, ())
    late = outcome_of(machine, fleet, nights_of(machine, from_night(first + 3, "inertia"), sound))
    assert (late.in_time, late.right) == (False, True)
    other = from_night(first + 1, "offset", "inertia")
    assert outcome_of(machine, fleet, nights_of(machine, other, sound)).right is False
    never = outcome_of(machine, fleet, nights_of(machine, {}, sound))
    assert (never.told_day, never.in_time, never.right) == (None, False, None)


def test_what_is_told_before_anything_changed_is_a_false_alarm_and_no_discovery() -> None:
    machine = machine_of("payload changed")
    fleet, sound = Fleet((machine,), DAYS, 3, 1), [1.0] * DAYS
    early = outcome_of(machine, fleet, nights_of(machine, from_night(3, "inertia"), sound))
    assert early.false_alarms == ("inertia on day 4",)
    assert early.told_day is None
    innocent = machine_of("hall warms")
    told = nights_of(innocent, {4: [alarm("offset")], 9: [alarm("offset")]}, sound)
    found = outcome_of(innocent, Fleet((innocent,), DAYS, 3, 1), told)
    assert len(found.false_alarms) == 2
    assert found.sound_days == DAYS
    assert found.in_time is None


def test_a_sound_machine_that_is_called_unlike_its_siblings_is_a_false_alarm() -> None:
    machine = machine_of("payload changed")
    onset = int(machine.onset_day)
    nights = nights_of(machine, {}, [1.0] * DAYS)
    nights.unlike = [{machine.name: ["inertia"]} if night >= 2 else {} for night in range(DAYS)]
    found = outcome_of(machine, Fleet((machine,), DAYS, 3, 1), nights)
    assert onset > 3
    assert found.false_alarms == ("inertia unlike its siblings on day 3",)
    nights.unlike = [{machine.name: ["inertia"]} if night >= onset else {} for night in range(DAYS)]
    assert not outcome_of(machine, Fleet((machine,), DAYS, 3, 1), nights).false_alarms


def test_a_drift_has_to_be_told_before_it_costs_a_fifth_of_the_tracking_error() -> None:
    machine = machine_of("friction rises")
    fleet, first = Fleet((machine,), DAYS, 3, 1), int(machine.onset_day)
    costly = [1.0] * (first + 4) + [1.3] * (DAYS - first - 4)
    for told, in_time in ((first + 4, True), (first + 5, False)):
        nights = nights_of(machine, from_night(told, "coulomb_friction"), costly)
        outcome = outcome_of(machine, fleet, nights)
        assert (outcome.costly_day, outcome.in_time) == (first + 5.0, in_time)
    figures = found_of(fleet, nights, [outcome], 1.0).figures
    assert {each.name: each.met for each in figures}["drifts"] is False


def test_where_the_residual_grew_the_name_is_what_the_diagnosis_says() -> None:
    machine = machine_of("encoder dirty")
    told = from_night(int(machine.onset_day) + 1, "residual_rms")
    nights = nights_of(machine, told, [1.0] * DAYS)
    fleet = Fleet((machine,), DAYS, 3, 1)
    for said, right in (("encoder_error", True), ("cogging, encoder_error", False)):
        nights.named[machine.name] = said
        assert outcome_of(machine, fleet, nights).right is right


def test_the_door_refuses_one_request_in_so_many_once_it_is_shut() -> None:
    def behind(_: dict[str, Any], respond: Callable[..., Any]) -> list[bytes]:
        respond("200 OK", [])
        return [b"log"]

    door, answers = Door(behind, one_in=4), []
    for k in range(16):
        door.is_shut = k >= 8
        door({}, lambda status, _: answers.append(status))
    assert [k for k, status in enumerate(answers) if status.startswith("503")] == [11, 15]
    assert (door.asked, door.refused) == (8, 2)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["fleet", "--days", "2"], "should be 8 or more"),
        (["fleet", "--only", "storm"], "the parts are nights, disturbances, scaling"),
    ],
)
def test_options_that_mean_nothing_are_refused(words: list[str], told: str) -> None:
    result = CliRunner().invoke(make_app(), ["bench", *words])
    assert result.exit_code != 0
    assert told in " ".join(str(result.exception or result.output).split())


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Some logs, and the store of a run that nothing disturbed."""
    folder = tmp_path_factory.mktemp("disturbed")
    logs = some_logs(folder / "logs", DISTURBED_LOGS, 1)
    undisturbed(logs, folder / "whole", 1)
    assert len(digests(folder / "whole")) == DISTURBED_LOGS
    return logs, folder / "whole"


@pytest.mark.slow
@pytest.mark.long
def test_killed_workers_change_no_finding(whole: tuple[Path, Path], tmp_path: Path) -> None:
    found = with_killed_workers(*whole, tmp_path, kills=3, workers=2, seed=1)
    assert (found.how_often, found.other) == (3, 0)
    assert found.logs >= DISTURBED_LOGS


@pytest.mark.slow
@pytest.mark.long
def test_a_killed_scheduler_changes_no_finding(whole: tuple[Path, Path], tmp_path: Path) -> None:
    found = with_killed_scheduler(*whole, tmp_path / "store", kills=1, workers=1)
    assert (found.how_often, found.runs, found.other) == (1, 2, 0)


@pytest.mark.slow
def test_a_store_that_refuses_requests_changes_no_finding(
    whole: tuple[Path, Path], tmp_path: Path
) -> None:
    found = with_refusing_store(*whole, tmp_path / "store", one_in=5, workers=1)
    assert found.other == 0
    assert found.how_often >= 3


@pytest.mark.slow
def test_findings_that_differ_are_counted(whole: tuple[Path, Path], tmp_path: Path) -> None:
    store = whole[1]
    expected = digests(store)
    others = some_logs(tmp_path / "logs", 1, 2)
    undisturbed(others, tmp_path / "store", 1)
    assert differing(expected, digests(tmp_path / "store")) == DISTURBED_LOGS + 1
    assert differing(expected, dict.fromkeys(expected, "")) == DISTURBED_LOGS
    assert differing(expected, expected) == 0


@pytest.mark.slow
def test_a_small_fleet_lives_with_its_truth_written_down(tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    found = fleet_findings(
        lambda _: None,
        FleetOptions(machines=2, days=8, logs_a_day=2, workers=1, folder=folder),
    )
    truth = json.loads((folder / "nights" / "truth.json").read_text())
    assert [each["kind"] for each in truth["machines"]] == list(KINDS)[:2]
    assert len(found.data["outcomes"]) == 2
    assert {figure.name for figure in found.figures} == {"steps", "drifts", "names", "false_alarms"}
    assert len(list((folder / "nights" / "findings").glob("findings/*/*.parquet"))) == 32
