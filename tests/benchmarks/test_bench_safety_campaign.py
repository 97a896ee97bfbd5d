"""The campaign of the guards: cases judged by arithmetic, and a campaign that cannot be fooled."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from motorctl.errors import UsageError
from motorctl_benchmarks.command import bench
from motorctl_benchmarks.safety import expectations, expected, fault_free, findings, kinds
from motorctl_benchmarks.safety.bus_cases import bus_keys
from motorctl_benchmarks.safety.bus_faults import COMPUTER, TITLES, WIRE
from motorctl_benchmarks.safety.bus_lines import BEAM_LINES, LINES
from motorctl_benchmarks.safety.bus_tables import END_TITLE, KILL_TITLE, WIRE_TITLE
from motorctl_benchmarks.safety.bus_tables import STATE_TITLE as BUS_STATES
from motorctl_benchmarks.safety.cases import CaseKey, keys, parse_case
from motorctl_benchmarks.safety.end_kinds import END_FAULTS
from motorctl_benchmarks.safety.expectations import EXPECTED
from motorctl_benchmarks.safety.expected import Expected
from motorctl_benchmarks.safety.fault_free import run_spell, spells
from motorctl_benchmarks.safety.findings import findings_of, parse_task, parse_tasks
from motorctl_benchmarks.safety.kinds import FAULTS
from motorctl_benchmarks.safety.plan import draw
from motorctl_benchmarks.safety.run_case import run_case
from motorctl_benchmarks.safety.table import FAULT_TITLE, QUIET_TITLE, STATE_TITLE

HANDFUL = (
    "gantry:C1:ring:encoder_lost:default:3",
    "gantry:C2:hold:shove:quick_stop:3",
    "serial:C2:cruise:encoder_stuck:default:3",
    "serial:C2:off:amplifier_fault:default:3",
    "modbus:C2:reaction:estop:default:3",
    "stage:C2:homing:silence:default:3",
    "dual:C2:cruise:end_encoder_stuck:quick_stop:3",
    "dual:C1:accelerate:end_dead_output:default:3",
    "dual:C2:hold:end_push:disable:3",
    "dual:C2:homing:end_amplifier_fault:default:3",
)
"""All machines and both controllers, on ticks that each other or other tests need anyhow."""


@pytest.mark.slow
@pytest.mark.parametrize("text", HANDFUL)
def test_a_fault_is_detected_by_its_guard_in_its_ticks_and_the_axis_comes_back(text):
    outcome = run_case(parse_case(text))
    assert outcome.failures == ()
    assert outcome.restart.clean
    assert outcome.rows_lost == 0


@pytest.mark.slow
@pytest.mark.parametrize("key", keys("full", 5)[::25], ids=str)
def test_cases_of_every_kind_are_as_promised(key):
    assert run_case(key).failures == ()


@pytest.mark.slow
def test_a_case_is_the_same_each_time():
    key = parse_case("modbus:C1:cruise:encoder_jump:default:8")
    assert run_case(key).document() == run_case(key).document()


def test_a_guard_that_is_switched_off_makes_the_campaign_say_missed(monkeypatch):
    off = replace(FAULTS["encoder_noise"], axis_keys=None)
    monkeypatch.setitem(kinds.FAULTS, "encoder_noise", off)
    outcome = run_case(parse_case("gantry:C2:hold:encoder_noise:default:1"))
    assert outcome.failures[0].startswith("missed: encoder_noise did not trip")
    found = findings_of([outcome], [], [])
    assert found.failed
    assert found.mistakes[0]["case"] == "gantry:C2:hold:encoder_noise:default:1"


def test_a_fault_that_another_guard_detects_by_luck_is_not_as_promised(monkeypatch):
    off = replace(FAULTS["encoder_stuck"], axis_keys=lambda _: {"guards": {"encoder_stuck": None}})
    monkeypatch.setitem(kinds.FAULTS, "encoder_stuck", off)
    outcome = run_case(parse_case("gantry:C2:cruise:encoder_stuck:default:1"))
    assert outcome.measured.guard == "following_error"
    assert any("should be encoder_stuck" in why for why in outcome.failures)


@pytest.mark.slow
def test_an_end_that_only_another_guard_sees_is_not_as_promised(monkeypatch):
    loose = {
        "dual_drive": {"max_out_of_square_m": 0.018},
        "guards": {"skew": {"limit_m": 0.015}},
    }
    off = replace(FAULTS["end_encoder_stuck"], axis_keys=lambda _: loose)
    monkeypatch.setitem(kinds.FAULTS, "end_encoder_stuck", off)
    outcome = run_case(parse_case("dual:C2:cruise:end_encoder_stuck:disable:1"))
    assert outcome.measured.guard == "following_error"
    assert any("should be skew" in why for why in outcome.failures)


def test_a_guard_that_comes_a_tick_too_late_is_not_as_promised(monkeypatch):
    early = lambda _case: Expected(("no_new_sample",), 2, 2)  # noqa: E731
    monkeypatch.setitem(expectations.EXPECTED, "silence", early)
    outcome = run_case(parse_case("gantry:C2:hold:silence:default:1"))
    assert outcome.failures == ("detected after 3 ticks, should be 2 to 2",)


def test_what_must_not_trip_is_told_where_it_does(monkeypatch):
    monkeypatch.setitem(expectations.EXPECTED, "silence", expected.nothing)
    outcome = run_case(parse_case("gantry:C2:hold:silence:default:1"))
    assert any(why.startswith("false trip: no_new_sample") for why in outcome.failures)


def test_every_fault_has_an_expectation_and_every_expectation_a_fault():
    assert set(FAULTS) == set(EXPECTED)


def tables_of_the_page():
    """Return the page's header, and each table by its title: its rows as cells, columns first."""
    page = (Path(__file__).parents[2] / "docs/campaign.md").read_text()
    text = page.partition("<!-- tables:")[2].partition("-->")[2].partition("<!-- end of tables")[0]
    tables, title = [], ""
    for line in text.splitlines():
        if line.startswith("**") and line.endswith("**"):
            title = line.strip("*")
            tables.append((title, []))
        elif line.startswith("|") and not line.startswith("| --"):
            tables[-1][1].append([cell.strip() for cell in line.strip("|").split("|")])
    return text.strip().partition("\n")[0], tables


HEAD, TABLES = tables_of_the_page()
RUN = re.search(r"^Commit .*, size (\w+), seed (\d+): ", HEAD)
SIZE, SEED = RUN.groups() if RUN else ("full", "1")
of_one_run = pytest.mark.skipif(
    RUN is None, reason="the page's tables are older than the line with commit, size and seed"
)


@pytest.mark.parametrize(("title", "rows"), TABLES)
def test_every_line_of_every_table_on_the_page_is_as_promised(title, rows):
    columns, *lines = rows
    for line in lines:
        told = dict(zip(columns, line, strict=True))
        shares = [told["as promised"]] if "as promised" in told else line[1:]
        for share in shares:
            if title == QUIET_TITLE:
                assert told["false trips"] == "0"
            elif share != "-":
                right, _, count = share.partition(" of ")
                assert right == count, (title, line)


@of_one_run
def test_the_page_has_every_table_once_with_a_line_or_column_for_all_that_was_run():
    assert [title for title, _ in TABLES] == [
        FAULT_TITLE,
        STATE_TITLE,
        WIRE_TITLE,
        BUS_STATES,
        END_TITLE,
        KILL_TITLE,
        QUIET_TITLE,
    ]
    found = dict(TABLES)
    virtual, buses = (
        keys(SIZE, int(SEED)),
        [k for k in bus_keys(SIZE, int(SEED)) if k.line in LINES],
    )
    first = {title: [row[0] for row in rows[1:]] for title, rows in found.items()}
    in_motion = [key for key in buses if key.fault in (*WIRE, *COMPUTER)]
    assert first[FAULT_TITLE] == list(dict.fromkeys(key.kind.title for key in virtual))
    assert first[WIRE_TITLE] == list(dict.fromkeys(TITLES[key.fault] for key in in_motion))
    assert set(found[STATE_TITLE][0][1:]) == {f"{k.machine} {k.controller}" for k in virtual}
    assert set(first[STATE_TITLE]) == {*(key.state for key in virtual), "all"}
    assert found[BUS_STATES][0][1:] == list(dict.fromkeys(key.line for key in in_motion))
    assert set(first[BUS_STATES]) == {*(key.state for key in buses), "all"}
    killed = [key.line for key in buses if key not in in_motion]
    assert first[KILL_TITLE] == list(dict.fromkeys(killed))
    spell_machines = {spell.machine for spell in spells(SIZE, int(SEED))}
    assert set(first[QUIET_TITLE]) == {*spell_machines, "all"}


@of_one_run
def test_the_pages_numbers_of_cases_are_those_of_its_tables():
    found = dict(TABLES)
    virtual, buses = (
        keys(SIZE, int(SEED)),
        [k for k in bus_keys(SIZE, int(SEED)) if k.line in LINES],
    )
    column = found[FAULT_TITLE][0].index("cases")
    assert sum(int(row[column]) for row in found[FAULT_TITLE][1:]) == len(virtual)
    wires = sum(int(row[column]) for row in found[WIRE_TITLE][1:])
    kills = sum(int(row[-1].split(" of ")[1]) for row in found[KILL_TITLE][1:])
    assert wires + kills == len(buses)
    of_buses = len(bus_keys(SIZE, int(SEED)))  # those of a beam have a table of their own
    assert f"{len(virtual) + of_buses} fault cases, {of_buses} of them over buses" in HEAD
    assert "all as promised" in HEAD


@of_one_run
def test_the_page_has_every_fault_of_one_end_of_a_beam_on_every_bus_that_was_run():
    ends = [key for key in bus_keys(SIZE, int(SEED)) if key.line in BEAM_LINES]
    columns, *rows = dict(TABLES)[END_TITLE]
    assert {(row[0], row[1]) for row in rows} == {(TITLES[key.fault], key.line) for key in ends}
    assert sum(int(row[columns.index("cases")]) for row in rows) == len(ends)


def test_the_full_campaign_has_more_than_five_hundred_cases_over_every_bus():
    virtual, buses = keys("full", 1), bus_keys("full", 1)
    assert len(virtual) >= 500
    assert {key.line.partition("-")[0] for key in buses} == {
        "serial",
        "can",
        "canopen",
        "modbus",
    }
    assert len({str(key) for key in [*virtual, *buses]}) == len(virtual) + len(buses)
    assert set(keys("small", 1)) < set(virtual)
    hours = len(spells("full", 1)) * fault_free.SPELL_S / 3600.0
    assert hours >= 10.0


@pytest.mark.parametrize(
    "of", [keys("full", 4)[::97], bus_keys("full", 4)[::17], spells("full", 4)[::31]]
)
def test_a_key_names_its_case(of):
    assert [parse_task(str(key)) for key in of] == of


def test_a_machine_names_all_of_its_cases():
    found = parse_tasks("dual")
    assert found == tuple(key for key in keys("full", 1) if key.machine == "dual")
    assert {key.controller for key in found} == {"C1", "C2"}


@pytest.mark.slow
def test_every_fault_of_one_end_meets_both_ends_and_only_a_beam_has_two():
    assert {kind.machines for kind in END_FAULTS.values()} == {("dual",)}
    for fault, kind in END_FAULTS.items():
        keys = [CaseKey("dual", "C2", kind.states[0], fault, "", seed) for seed in range(9)]
        assert {draw(key).broken for key in keys} == {(0,), (1,)}


def test_a_bus_names_all_of_its_cases():
    found = parse_tasks("bus:canopen-udp")
    assert found == tuple(key for key in bus_keys("full", 1) if key.line == "canopen-udp")
    assert {key.controller for key in found} == {"C1", "C2"}
    one = "bus:serial-poll:C2:shuttle:silence:default:1"
    assert parse_tasks(one) == (parse_task(one),)


@pytest.mark.parametrize(
    "text",
    [
        "gantry:C2:cruise:encoder_stuck:1",
        "gantry:C3:cruise:encoder_stuck:default:1",
        "gantry:C2:homing:encoder_stuck:default:1",
        "bus:can-udp:C2:shuttle:bit_errors:default:1",
        "bus:can-udp:C2:cruise:silence:default:1",
        "bus:can-udp:C2:shuttle:silence:quick_stop:1",
        "bus:can-udp:C2:shuttle:silence:default:x",
        "free:nowhere:C2:1",
    ],
)
def test_a_key_that_names_no_case_is_refused_with_an_example(text):
    with pytest.raises(UsageError, match="as in"):
        parse_task(text)


@pytest.mark.slow
def test_the_tables_totals_are_those_of_the_cases():
    outcomes = [run_case(parse_case(text)) for text in HANDFUL]
    outcomes[0] = replace(outcomes[0], failures=("made up",))
    by_fault, by_state = findings_of(outcomes, [], []).tables
    column = dict(zip(by_fault.columns, zip(*by_fault.rows, strict=True), strict=True))
    assert sum(map(int, column["cases"])) == len(outcomes)
    assert sum(int(cell.split(" of ")[0]) for cell in column["as promised"]) == len(outcomes) - 1
    assert by_state.rows[-1][0] == "all"
    shares = [cell.split(" of ") for cell in by_state.rows[-1][1:]]
    assert sum(int(right) for right, _ in shares) == len(outcomes) - 1
    assert sum(int(count) for _, count in shares) == len(outcomes)
    assert all(line.startswith("|") for line in by_fault.lines()[2:])


@pytest.mark.slow
def test_motion_without_a_fault_trips_nothing():
    quiet = run_spell(spells("small", 1)[0], 12.0)
    assert quiet.trip == ""
    assert quiet.moves > 5


def test_a_false_trip_is_told(monkeypatch):
    tight = {"thermal": {"continuous_voltage_v": 0.2, "time_constant_s": 0.5}, "saturation": None}
    monkeypatch.setattr(fault_free, "guards_of", lambda _machine: tight)
    quiet = run_spell(spells("small", 1)[0], 12.0)
    assert "thermal" in quiet.trip
    assert findings_of([], [], [quiet]).failed


# The command


def _in_this_process(run, tasks, progress, _workers, _out):
    return [run(task) for task in tasks]


def _command(*arguments):
    return CliRunner().invoke(bench, ["campaign", *arguments])


def test_the_command_ends_with_1_where_a_case_is_not_as_promised(monkeypatch):
    monkeypatch.setattr(findings, "run_tasks", _in_this_process)
    key = "gantry:C2:hold:silence:default:1"
    right = _command("--only", key, "--json")
    assert right.exit_code == 0
    assert json.loads(right.stdout)["cases"][0]["case"] == key
    monkeypatch.setitem(expectations.EXPECTED, "silence", expected.nothing)
    wrong = _command("--only", key)
    assert wrong.exit_code == 1
    assert f"- wrong  {key}" in wrong.stdout
    assert wrong.stdout.startswith("Commit ")
    assert "1 fault cases, 0 of them over buses, 1 of them NOT as promised." in wrong.stdout
    assert "| no new sample comes any more | 1 " in wrong.stdout
