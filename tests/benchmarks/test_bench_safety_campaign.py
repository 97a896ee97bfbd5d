"""The campaign of the guards: cases judged by arithmetic, and a campaign that cannot be fooled."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from motorctl.config import load
from motorctl.errors import UsageError
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl_benchmarks.buses.transports import transports
from motorctl_benchmarks.command import bench
from motorctl_benchmarks.safety import expectations, expected, fault_free, findings, kinds
from motorctl_benchmarks.safety.bus_case import bus_keys, judged, parse_bus
from motorctl_benchmarks.safety.bus_lines import LINES, NOT_ORDERED, NOT_TRIED, WIRE, promise
from motorctl_benchmarks.safety.bus_session import Kept, Session, Spell
from motorctl_benchmarks.safety.cases import CaseKey, keys, parse_case
from motorctl_benchmarks.safety.end_kinds import END_FAULTS
from motorctl_benchmarks.safety.expectations import EXPECTED
from motorctl_benchmarks.safety.expected import Expected
from motorctl_benchmarks.safety.fault_free import run_spell, spells
from motorctl_benchmarks.safety.findings import findings_of, parse_task, parse_tasks
from motorctl_benchmarks.safety.kinds import FAULTS
from motorctl_benchmarks.safety.plan import draw
from motorctl_benchmarks.safety.run_case import run_case
from motorctl_devices.orders import FaultKind

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


def test_the_page_has_a_line_for_every_fault_and_every_line_is_as_promised():
    page = (Path(__file__).parents[2] / "docs/campaign.md").read_text()
    table = page.partition("<!-- tables:")[2].partition("<!-- end of tables -->")[0]
    lines = {line.split("|")[1].strip(): line for line in table.splitlines() if "|" in line}
    titles = [kind.title for kind in FAULTS.values()] + [title for title, _ in WIRE.values()]
    for title in titles:
        right, _, count = lines[title].split("|")[-2].strip().partition(" of ")
        assert right == count


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
    assert parse_tasks(KEY) == (parse_task(KEY),)


@pytest.mark.parametrize(
    "text",
    [
        "gantry:C2:cruise:encoder_stuck:1",
        "gantry:C3:cruise:encoder_stuck:default:1",
        "gantry:C2:homing:encoder_stuck:default:1",
        "bus:can-udp:C2:bit_errors:1",
        "bus:can-udp:C2:silence:x",
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
    app = typer.Typer()
    app.command()(bench)
    return CliRunner().invoke(app, ["campaign", *arguments])


def test_the_command_ends_with_1_where_a_case_is_not_as_promised(monkeypatch):
    monkeypatch.setattr(findings, "run_tasks", _in_this_process)
    key = "gantry:C2:hold:silence:default:1"
    right = _command("--only", key, "--json")
    assert right.exit_code == 0
    assert json.loads(right.stdout)["cases"][0]["case"] == key
    monkeypatch.setitem(expectations.EXPECTED, "silence", expected.nothing)
    wrong = _command("--only", key)
    assert wrong.exit_code == 1
    assert f"wrong  {key}" in wrong.stdout
    assert "| no new sample comes any more | 1 " in wrong.stdout


def test_the_command_refuses_options_of_other_subjects():
    refused = _command("--cases", "3")
    assert isinstance(refused.exception, UsageError)
    assert "campaign takes no --cases" in str(refused.exception)


# Buses


KEY = "bus:serial-poll:C2:silence:1"
RATE_HZ, BEGAN, AT_S = 500.0, 100, 0.8


def kept_log(*, held=75, cause=FaultCause.NO_NEW_SAMPLE, volts_after=0.0, lost=0):
    """Return a log in which both axes are held over, trip, and stay in fault."""
    silent = BEGAN + round(AT_S * RATE_HZ)
    trip, rows = silent + held, silent + 500
    state = np.full(rows, int(AxisState.RUNNING))
    state[:BEGAN], state[trip:] = AxisState.OFF, AxisState.FAULT
    fault = np.where(np.arange(rows) >= trip, int(cause), 0)
    flags = np.zeros(rows, np.int64)
    flags[silent : rows - 50] = SampleFlag.HELD
    command = np.where(state == AxisState.RUNNING, 0.5, 0.0)
    command[trip + 1] = volts_after
    axis = AxisRecording(
        "x",
        position=np.linspace(0.0, 0.01, rows),
        position_unit="m",
        command=command,
        command_unit="V",
        state=state,
        fault=fault,
        flags=flags,
    )
    time_s = np.arange(rows) / RATE_HZ
    log = Recording("made", RATE_HZ, time_s, {"x": axis, "y": axis}, lateness_s=np.zeros(rows))
    told = {"fired": 9, "off_after_s": 0.251, "watchdog_trips": 1, "longest_pause_s": 0.0}
    spell = Spell(
        "silence", AT_S, "still_faulty", "", {"x": "running", "y": "running"}, time_s[-1], told
    )
    return Kept(Session("serial-poll", "C2", ("silence",), 1), (spell,), log, lost)


def outcome_of(kept):
    (outcome,) = judged(kept, [parse_bus(KEY)])
    return outcome


def test_a_fault_on_a_bus_is_judged_by_the_log_and_the_devices_report():
    outcome = outcome_of(kept_log())
    assert outcome.failures == ()
    assert (outcome.guard, outcome.held_ticks) == ("no_new_sample", 76)
    assert outcome.travel_mm == pytest.approx(5.0, rel=0.01)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"held": 90}, "91 ticks without a sample"),
        ({"held": 50}, "51 ticks without a sample"),
        ({"cause": FaultCause.FOLLOWING_ERROR}, "should be no_new_sample"),
        ({"volts_after": 0.1}, "volts after the trip"),
        ({"lost": 3}, "3 rows lost"),
    ],
)
def test_what_is_not_as_promised_on_a_bus_is_told(changes, why):
    assert any(why in failure for failure in outcome_of(kept_log(**changes)).failures)


def test_a_device_whose_amplifiers_stay_on_is_told():
    kept = kept_log()
    kept.spells[0].told["off_after_s"] = None
    assert "an amplifier was still on" in outcome_of(kept).failures


def test_every_line_is_promised_something_for_silence():
    assert {promise(line, "silence").guard for line in LINES} == {"no_new_sample"}


def test_every_fault_of_the_wire_is_tried_on_every_bus_or_it_is_written_why_not():
    tried = {(key.line, key.fault) for key in bus_keys("full", 1)}
    pairs = {(line, fault) for line in LINES for fault in WIRE}
    assert pairs - tried == set(NOT_TRIED)
    assert all(len(why.split()) > 3 for why in NOT_TRIED.values())
    both = [key for key in pairs if key in tried]
    assert len(bus_keys("full", 1)) == 2 * len(both)  # C1 and C2


def test_every_bus_that_there_is_belongs_to_the_campaign():
    emulated = {bus.name.replace("udp_multicast", "udp").replace(" ", "-") for bus in transports()}
    assert set(LINES) == emulated
    drivers = entry_points(group="motorctl.drivers")
    shipped = {entry.name for entry in drivers if entry.value.startswith("motorctl_")}
    configs = {line.config for line in LINES.values()}
    driven = {load(config).resolved["drivers"]["gantry"]["type"] for config in configs}
    assert driven == shipped - {"sim"}


def test_every_order_of_a_device_is_a_fault_of_the_wire_or_it_is_written_why_not():
    ordered = {order["kind"] for _, order in WIRE.values()}
    assert not ordered & set(NOT_ORDERED)
    assert ordered | set(NOT_ORDERED) == set(get_args(FaultKind))


@pytest.mark.slow
@pytest.mark.wall_clock
def test_a_bus_that_falls_silent_is_as_promised_in_real_time(monkeypatch):
    import real_time

    real_time.begins()
    result = _command("--only", KEY)
    assert result.exit_code == 0, result.stdout
    assert "| nothing passes | 1     | no_new_sample |" in result.stdout
