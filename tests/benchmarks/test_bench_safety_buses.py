"""The campaign on buses: which cases there are, and how log and report of a session are judged."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import get_args

import numpy as np
import pytest
import real_time
import yaml
from typer.testing import CliRunner

from motorctl.config import load
from motorctl.errors import UsageError
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl_benchmarks.buses.transports import transports
from motorctl_benchmarks.command import bench
from motorctl_benchmarks.safety.bus_case import judged
from motorctl_benchmarks.safety.bus_cases import bus_keys, parse_bus
from motorctl_benchmarks.safety.bus_expectations import (
    NOT_MET,
    NOT_TRIED,
    STATES,
    is_possible,
    promise,
    ramp_s,
)
from motorctl_benchmarks.safety.bus_faults import COMPUTER, ENDS, KILLS, NOT_ORDERED, ORDERS, WIRE
from motorctl_benchmarks.safety.bus_kills import kill_judged
from motorctl_benchmarks.safety.bus_lines import BEAM_LINES, LINES, STOP, device_file, host_file
from motorctl_benchmarks.safety.bus_run import sessions_of
from motorctl_benchmarks.safety.bus_session import Kept, Spell
from motorctl_benchmarks.safety.findings import findings_of
from motorctl_devices import load_device
from motorctl_devices.orders import FaultKind

KEY = "bus:serial-poll:C2:shuttle:silence:default:1"
RATE_HZ, BEGAN, AT_S, ORIGIN_S = 500.0, 100, 0.8, 1234.5
BY_COMMAND = {"off_after_s": 0.152, "watchdog_trips": 0}
"""What a device reports that was told to disable, after 75 ticks without a sample."""
PAUSED = "bus:can-udp:C2:cruise:host_pause:quick_stop:1"


def kept_log(
    key=KEY,
    *,
    met=AxisState.RUNNING,
    held=75,
    cause=FaultCause.NO_NEW_SAMPLE,
    volts_after=0.0,
    lost=0,
    off_s=0.001,
    ramp_s=0.0,
    speed_m_s=0.1,
    **told,
):
    """Return a session in which both axes are held over, trip, brake, and stay in fault.

    off_s is when the device's amplifiers were off, after the loop let its axes go.
    """
    silent = BEGAN + round(AT_S * RATE_HZ)
    trip, rows = silent + held, silent + 500
    let_go = trip + round(ramp_s * RATE_HZ)
    number = np.arange(rows)
    state = np.full(rows, int(met))
    state[:BEGAN], state[trip:let_go] = AxisState.IDLE, AxisState.STOPPING
    state[0] = AxisState.OFF
    if cause:
        state[let_go:] = AxisState.FAULT
    fault = np.where(number >= trip, int(cause), 0)
    flags = np.zeros(rows, np.int64)
    flags[silent : rows - 50] = SampleFlag.HELD
    command = np.where((state == AxisState.FAULT) | (state == AxisState.OFF), 0.0, 0.5)
    command[let_go + 1] += volts_after
    braked = np.clip((number - trip) / max(1, let_go - trip), 0.0, 1.0)
    axis = AxisRecording(
        "x",
        position=np.linspace(0.0, 0.01, rows),
        position_unit="m",
        reference_velocity=speed_m_s * (1.0 - braked),
        command=command,
        command_unit="V",
        state=state,
        fault=fault,
        flags=flags,
    )
    time_s = number / RATE_HZ
    log = Recording("made", RATE_HZ, time_s, {"x": axis, "y": axis}, lateness_s=np.zeros(rows))
    report = {"fired": 9, "off_after_s": 0.251, "watchdog_trips": 1, "longest_pause_s": 0.0} | told
    spell = Spell(
        parse_bus(key),
        AT_S + (BEGAN - 1) / RATE_HZ,
        refused="still_faulty",
        started={"x": "running", "y": "running"},
        status_time_s=time_s[-1],
        told=report,
    )
    off = ORIGIN_S + time_s[let_go] + off_s
    return Kept((spell,), log, lost, ORIGIN_S, 0.0, ((off, None),))


def outcome_of(kept):
    (outcome,) = judged(kept)
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


def test_the_device_itself_tells_when_the_loops_zero_volts_were_there():
    key = "bus:serial-poll:C2:shuttle:loss:default:1"
    in_time = outcome_of(kept_log(key, off_s=0.0035, **BY_COMMAND))
    assert in_time.failures == ()
    assert in_time.command_ms == pytest.approx(3.5, abs=0.01)
    late = outcome_of(kept_log(key, off_s=0.03, **BY_COMMAND))
    assert any("volts at the device until 30.0 ms" in why for why in late.failures)


def test_a_fault_that_did_not_meet_its_state_is_no_case_of_it():
    key = "bus:serial-poll:C2:stop:silence:default:1"
    assert outcome_of(kept_log(key, met=AxisState.STOPPING)).failures == ()
    missed = outcome_of(kept_log(key, met=AxisState.IDLE))
    assert "axis x: was idle, should be in stop" in missed.failures


def test_an_axis_that_is_off_stays_off_and_comes_back_as_is_expected():
    key = "bus:serial-poll:C2:off:long_reset:default:1"
    kept = kept_log(key, met=AxisState.OFF, cause=FaultCause.NONE, off_after_s=0.0)
    kept.spells[0].told_reset = True
    assert outcome_of(kept).failures == ()
    kept.spells[0].told_reset = False
    assert "started without a reset, should be only after one" in outcome_of(kept).failures
    tripped = kept_log(key, met=AxisState.OFF, off_after_s=0.0)
    assert "axis x: false trip: no_new_sample" in outcome_of(tripped).failures


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
def test_every_bus_takes_the_configuration_of_a_session_that_homes(tmp_path, line):
    endpoint = "127.0.0.1:1502" if "tcp" in line.name else "/dev/gantry"
    config = tmp_path / "gantry.yaml"
    config.write_text(host_file(line, "C2", endpoint, 43113, "homes"))
    assert {axis.homing.method for axis in load(config).axes.values()} == {"switch"}
    device = tmp_path / "device.yaml"
    device.write_text(device_file(line, 43113, []))
    assert load_device(device).machine.channels == 2


def test_late_ticks_are_judged_as_a_ramp():
    paused = {"held": 40, "cause": FaultCause.OVERRUN, "off_after_s": None, "watchdog_trips": 0}
    least_s, right_s = ramp_s(0.1, *STOP.values())
    assert (least_s, right_s) == pytest.approx((0.1 / 0.15, 0.1 / 0.15 + 0.15 / 20.0))
    outcome = outcome_of(_unordered(kept_log(PAUSED, ramp_s=right_s, **paused)))
    assert outcome.failures == ()
    assert outcome.ramp_ms == pytest.approx(1e3 * right_s, abs=3.0)
    hard = outcome_of(_unordered(kept_log(PAUSED, ramp_s=0.3, **paused)))
    assert any("braked for 300 ms, should be" in why for why in hard.failures)
    none = outcome_of(_unordered(kept_log(PAUSED, **paused)))
    assert "axis x: no ramp, or one without an end" in none.failures


def _unordered(kept):
    """Return a session whose device was ordered nothing."""
    kept.spells[0].told = {}
    return kept


@pytest.mark.parametrize(
    ("fault", "changes", "why"),
    [
        ("both_killed", {}, None),
        ("both_killed", {"watchdog_trips": 0}, "tripped 0 times, should be once"),
        ("both_killed", {"watchdog_after_s": 0.4}, "off 400.0 ms after the last command"),
        ("both_killed", {"off_s": [(100.4, None)]}, "off 400.0 ms after the kill, should be 250"),
        ("both_killed", {"off_s": [(90.0, 91.0)]}, "an amplifier was still on"),
        ("loop_killed", {"watchdog_trips": 0}, None),
        ("loop_killed", {}, "tripped 1 times, should not"),
        ("loop_killed", {"watchdog_trips": 0, "off_s": [(103.0, None)]}, "3000.0 ms after the k"),
    ],
)
def test_the_loops_death_is_judged_by_the_devices_own_report(fault, changes, why):
    report = {"watchdog_trips": 1, "longest_pause_s": 0.0, "watchdog_after_s": 0.2501}
    report |= {"off_s": [(0.0, 97.0), (100.249, None)]} | changes
    key = parse_bus(f"bus:serial-poll:C2:shuttle:{fault}:default:1")
    outcome = kill_judged(key, report, 0.25, (100.0, 100.001))
    assert [told for told in outcome.failures if why and why in told] == list(outcome.failures)
    assert bool(outcome.failures) == bool(why)
    assert findings_of([], [outcome], []).failed == bool(why)


@pytest.mark.parametrize(("line", "clean"), [("canopen-udp", True), ("serial-poll", False)])
def test_a_drive_that_waits_for_heartbeats_may_be_off_a_heartbeat_sooner(line, clean):
    report = {"watchdog_trips": 1, "longest_pause_s": 0.0, "watchdog_after_s": 0.2501}
    report |= {"off_s": [(100.2, None)]}
    key = parse_bus(f"bus:{line}:C2:shuttle:both_killed:default:1")
    assert kill_judged(key, report, 0.25, (100.0, 100.001)).right is clean
    report |= {"off_s": [(100.15, None)]}
    assert not kill_judged(key, report, 0.25, (100.0, 100.001)).right


def test_whatever_an_axis_does_under_power_the_guards_of_the_wire_see_the_same():
    assert {promise(line, "shuttle", "silence").guard for line in LINES} == {"no_new_sample"}
    for state in ("hold", "stop", "homing"):
        for line in LINES:
            for fault in WIRE:
                if is_possible(line, state, fault):
                    assert promise(line, state, fault) == promise(line, "shuttle", fault)


@pytest.mark.parametrize("seed", range(1, 60))
def test_a_draw_brings_each_line_into_each_state_and_each_state_each_fault(seed):
    every = bus_keys("full", seed)
    full = [key for key in every if key.line in LINES]
    possible = [
        (line, state, fault)
        for line in LINES
        for state in STATES
        for fault in (*WIRE, *COMPUTER)
        if is_possible(line, state, fault)
    ]
    drawn = [(key.line, key.state, key.fault) for key in full]
    assert len(drawn) == len({str(key) for key in full})
    assert {(line, state) for line, state, _ in drawn} == {(p[0], p[1]) for p in possible}
    assert {case[1:] for case in drawn if case[2] not in KILLS} == {p[1:] for p in possible}
    assert set(drawn) - {case for case in drawn if case[2] in KILLS} <= set(possible)
    assert {key.line for key in full if key.fault in KILLS} == set(LINES)
    assert set(bus_keys("small", seed)) < set(every)


def test_what_is_not_tried_in_a_state_has_a_reason_and_the_draw_depends_on_the_seed():
    for why in NOT_MET.values():
        assert len(why.split()) > 3
    drawn = [{str(k).rpartition(":")[0] for k in bus_keys("full", seed)} for seed in (1, 3)]
    assert drawn[0] != drawn[1]


def test_a_session_has_one_bus_controller_and_setup_and_no_case_is_left():
    keys = bus_keys("full", 1)
    sessions = sessions_of(keys)
    assert sorted(str(key) for s in sessions for key in s.keys) == sorted(map(str, keys))
    for session in sessions:
        assert len({(k.line, k.controller, k.setup) for k in session.keys}) == 1
        assert len(session.keys) == 1 or not any(k.fault in KILLS for k in session.keys)


def test_every_fault_of_the_wire_is_tried_on_every_bus_or_it_is_written_why_not():
    moving = [key for key in bus_keys("full", 1) if key.state == "shuttle" and key.fault in ORDERS]
    tried = {(key.line, key.fault) for key in moving}
    pairs = {(line, fault) for line in LINES for fault in WIRE}
    pairs |= {(line, fault) for line in BEAM_LINES for fault in ENDS}
    assert pairs - tried == set(NOT_TRIED)
    assert all(len(why.split()) > 3 for why in NOT_TRIED.values())
    both = [key for key in pairs if key in tried]
    assert len(moving) == 2 * len(both)  # C1 and C2


def test_every_bus_that_there_is_belongs_to_the_campaign():
    emulated = {bus.name.replace("udp_multicast", "udp").replace(" ", "-") for bus in transports()}
    assert set(LINES) == emulated
    drivers = entry_points(group="motorctl.drivers")
    shipped = {entry.name for entry in drivers if entry.value.startswith("motorctl_")}
    configs = {line.config for line in LINES.values()}
    driven = {load(config).resolved["drivers"]["gantry"]["type"] for config in configs}
    assert driven == shipped - {"sim"}


def test_a_beam_is_broken_behind_every_kind_of_bus():
    driven = {
        yaml.safe_load(host_file(line, "C2", "127.0.0.1:1502", 43113))["drivers"]["gantry"]["type"]
        for line in BEAM_LINES.values()
    }
    assert driven == {"serial", "can", "canopen", "modbus"}
    assert {name.removesuffix("-beam") for name in BEAM_LINES} == driven
    # A drive of CANopen tells of its lost encoder as of any trouble: it is in Fault.
    guards = {line: promise(line, "shuttle", "lost_end").guard for line in BEAM_LINES}
    assert guards.pop("canopen-beam") == "amplifier"
    assert set(guards.values()) == {"encoder_lost"}


def test_every_order_of_a_device_is_a_fault_of_the_wire_or_it_is_written_why_not():
    ordered = {order["kind"] for _, order in ORDERS.values()}
    assert not ordered & set(NOT_ORDERED)
    assert ordered | set(NOT_ORDERED) == set(get_args(FaultKind))


@pytest.mark.slow
@pytest.mark.wall_clock
def test_a_bus_that_falls_silent_is_as_promised_in_real_time():
    real_time.begins()
    keys = [KEY, KEY.replace("shuttle", "hold"), KEY.replace("shuttle", "off")]
    result = _command(*(word for key in keys for word in ("--only", key)))
    assert result.exit_code == 0, result.stdout
    assert "| nothing passes | 3     | no_new_sample |" in result.stdout


def test_a_beam_meets_what_its_ends_may_do_apart_and_nothing_that_is_of_a_whole_wire():
    for line in BEAM_LINES:
        assert not any(is_possible(line, state, fault) for state in STATES for fault in WIRE)
    assert not any(is_possible(line, s, fault) for line in LINES for s in STATES for fault in ENDS)
    slipped, lost, broken, silent = (promise("can-beam", "shuttle", fault) for fault in ENDS)
    assert [p.guard for p in (slipped, lost, broken, silent)] == [
        "skew", "encoder_lost", "amplifier", "no_new_sample",
    ]  # fmt: skip
    for key in (
        "bus:can-beam:C2:shuttle:loss:default:1",
        "bus:can-udp:C2:shuttle:silent_end:default:1",
        "bus:serial-beam:C2:shuttle:silent_end:default:1",
        "bus:modbus-beam:C2:shuttle:silent_end:default:1",
        "bus:can-beam:C2:shuttle:loop_killed:default:1",
        "bus:can-beam:C2:cruise:host_pause:quick_stop:1",
    ):
        with pytest.raises(UsageError, match="no case on a bus"):
            parse_bus(key)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.wall_clock
def test_whatever_one_end_of_a_beam_does_alone_is_as_promised_in_real_time():
    real_time.begins()
    keys = [k for k in bus_keys("full", 1) if k.line in BEAM_LINES and k.controller == "C2"]
    result = _command(*(word for key in keys for word in ("--only", str(key))))
    assert result.exit_code == 0, result.stdout
    assert f"{len(keys)} of them over buses, all as promised" in result.stdout


@pytest.mark.slow
@pytest.mark.wall_clock
def test_a_ramp_meets_a_fault_and_late_ticks_begin_one_in_real_time():
    real_time.begins()
    stop = KEY.replace("shuttle", "stop")
    result = _command("--only", stop, "--only", PAUSED.replace("can-udp", "serial-poll"))
    assert result.exit_code == 0, result.stdout
    assert "overrun" in result.stdout


@pytest.mark.slow
@pytest.mark.wall_clock
@pytest.mark.parametrize(
    "line", ["serial-poll", pytest.param("canopen-udp", marks=pytest.mark.long)]
)
def test_a_loop_that_is_killed_leaves_a_device_that_is_off_in_time(line):
    real_time.begins()
    keys = [f"bus:{line}:C2:shuttle:{fault}:default:1" for fault in KILLS]
    result = _command("--only", keys[0], "--only", keys[1])
    assert result.exit_code == 0, result.stdout
    assert "2 of 2" in result.stdout


def _command(*arguments):
    return CliRunner().invoke(bench, ["campaign", *arguments])
