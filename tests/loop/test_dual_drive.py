"""A beam with two motors is one axis: its mean is led, its skew held, both motors stop at once."""

import dataclasses
import inspect
import math

import numpy as np
import pytest
from beam_bench import Held, absolute, beam, on_plant, with_dual
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import Hand, Rig, gantry, with_axes

from motorctl.daemon.axis_faults import faults_of
from motorctl.hal import Status, error_bits
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Reply, Verb
from motorctl.loop.compose import compose_tick

pytestmark = pytest.mark.slow

LIMIT_V = 10.0
IN_PHASE = {"following_error": {"filter_time_s": 1e3}}
"""Limits of an axis that never trips on its following error."""


def told(rig) -> str:
    return faults_of(rig.machine, rig.memory.axis_status)["x"]["message"]


def moved(machine, seconds: float = 1.0) -> Rig:
    """Let the beam move by 0.3 m and come to rest."""
    rig = Rig(machine)
    with rig:
        rig.start()
        rig.seconds(0.3)
        rig.follow_programs(["shuttle"])
        rig.seconds(seconds)
        rig.raise_faults()
    return rig


# One axis


def test_a_beam_moves_as_one_axis_whose_position_is_the_mean_of_its_ends():
    with Rig(absolute(beam())) as rig:
        rig.start()
        rig.move("x", 0.3)
        rig.seconds(1.5)
        rig.raise_faults()
        true = rig.driver.true_state().position_m
        assert rig.last("x")["position_m"] == pytest.approx(0.3, abs=2e-6)
        assert true.mean() == pytest.approx(0.3, abs=2e-6)
        assert rig.last("x")["skew_m"] == pytest.approx(true[0] - true[1], abs=1e-6)


def test_one_encoder_that_counts_backwards_and_from_elsewhere_changes_nothing():
    turned = with_dual(absolute(beam()), encoder_direction=-1)
    turned = on_plant(turned, plants={1: {"encoder": {"reversed": True}}})
    rows = [moved(machine, 0.8).rows("x") for machine in (absolute(beam()), turned)]
    assert np.array_equal(rows[0]["position_m"], rows[1]["position_m"])
    assert np.array_equal(rows[0]["skew_m"], rows[1]["skew_m"])


def test_a_motor_that_is_mounted_the_other_way_round_gets_its_volts_turned_round():
    with Held() as straight, Held(dual_drive={"motor_direction": -1}) as turned:
        for rig in (straight, turned):
            rig.put(20e-6, -40e-6)
            rig.advance(1)
        assert turned.driver.volts[0] == straight.driver.volts[0] != 0.0
        assert turned.driver.volts[1] == -straight.driver.volts[1] != 0.0


def test_counters_of_the_ends_may_wrap_one_by_one():
    narrow = with_axes(absolute(beam(), 1e-4), ["x"], encoder={"counter_bits": 20})  # 0.52 m
    rows = [moved(machine, 0.8).rows("x") for machine in (absolute(beam(), 1e-4), narrow)]
    assert np.array_equal(rows[0]["position_m"], rows[1]["position_m"])


def test_a_machine_without_a_dual_drive_has_a_tick_that_knows_nothing_of_one():
    lists = [axis.model for axis in gantry().axes.values()]
    plain = inspect.getsource(compose_tick(lists, [0, 1], [1, 1]))
    assert plain == inspect.getsource(compose_tick(lists, [0, 1], [1, 1], [None, None]))
    assert "dual" not in plain
    assert "dual" in inspect.getsource(compose_tick(lists, [0, 1], [1, 1], [2, None]))


# Skew


def test_the_skew_loop_holds_the_ends_together_under_an_off_centre_load():
    loose = with_dual(
        with_axes(absolute(beam()), guards={"skew": {"limit_m": 0.05}}),
        skew={"ks_v_s_m": 1e-9, "gamma_d": 0.0},
    )
    held, free = (
        np.abs(moved(machine, 2.0).rows("x")["skew_m"]) for machine in (absolute(beam()), loose)
    )
    assert free.max() > 0.5e-3
    assert held.max() < 0.1 * free.max()


def test_a_beam_that_stands_askew_is_started_without_a_jolt_and_squared_slowly():
    apart_m = 0.6e-3
    with Rig(absolute(beam(), apart_m)) as rig:
        rig.start()
        first = rig.rows("x")[-1]
        assert first["skew_m"] == pytest.approx(apart_m, abs=2e-6)
        assert first["skew_command_v"] == 0.0
        rig.seconds(0.5)
        reference = rig.rows("x")["skew_reference_m"]
        assert np.abs(np.diff(reference)).max() <= 0.002 * 0.2e-3 + 1e-12
        assert abs(rig.last("x")["skew_m"]) < 3e-6
        assert abs(np.diff(rig.rows("x")["skew_command_v"])).max() < 0.2


def test_the_two_commands_differ_by_twice_the_logged_one():
    with Held() as rig:
        rig.put(30e-6, -10e-6)
        rig.advance(1)
        row = rig.last("x")
        assert row["skew_m"] == pytest.approx(40e-6)
        assert row["skew_command_v"] < 0.0
        assert rig.driver.volts[0] == row["command_v"] + row["skew_command_v"]
        assert rig.driver.volts[1] == row["command_v"] - row["skew_command_v"]


PLACES = st.lists(
    st.tuples(st.floats(-0.5e-3, 0.5e-3), st.floats(-0.5e-3, 0.5e-3)), min_size=1, max_size=40
)


@settings(max_examples=25)
@given(places=PLACES, most=st.floats(0.1, 9.9), ks=st.floats(1.0, 1e4))
def test_neither_motor_gets_more_than_its_limit_whatever_skew_and_law_ask_for(places, most, ks):
    skew = {"max_voltage_v": most, "ks_v_s_m": ks}
    with Held(
        dual_drive={"skew": skew}, guards={"skew": {"limit_m": 0.05}}, limits=IN_PHASE
    ) as rig:
        for first, second in places:
            rig.put(first, second)
            rig.advance(1)
            row, volts = rig.last("x"), rig.driver.volts
            assert np.isfinite(volts).all()
            assert np.abs(volts).max() <= LIMIT_V
            assert abs(row["skew_command_v"]) <= most
            assert abs(row["command_v"]) + abs(row["skew_command_v"]) <= LIMIT_V * (1 + 1e-12)
            # What is logged is what left: no limit took anything away after the law.
            assert volts[0] == pytest.approx(row["command_v"] + row["skew_command_v"], abs=1e-12)


def test_the_skew_is_held_though_the_mean_stands_at_its_limit():
    with Held(guards={"skew": {"limit_m": 0.05}}, limits=IN_PHASE) as rig:
        for k in range(1, 40):
            rig.put(-0.1e-3 * k, -0.3e-3 * k)
            rig.advance(1)
        row = rig.last("x")
        assert rig.state_of("x") is AxisState.IDLE
        assert row["skew_command_v"] == -4.0
        assert row["command_v"] == LIMIT_V - 4.0
        assert tuple(rig.driver.volts) == (2.0, 10.0)


def test_a_motor_at_its_limit_trips_though_the_mean_is_below_it():
    guards = {"skew": {"limit_m": 0.05}, "saturation": {"time_s": 0.01}}
    with Held(guards=guards, limits=IN_PHASE) as rig:
        for k in range(200):
            apart = 5e-6 * k
            rig.put(-0.35e-3 + apart, -0.35e-3 - apart)
            rig.advance(1)
        assert rig.fault_of("x") is FaultCause.SATURATION
        last = rig.rows("x")[150:]
        assert np.abs(last["command_v"]).max() <= LIMIT_V - 4.0


def test_the_last_skew_command_stands_without_a_new_sample():
    with Held() as rig:
        rig.put(30e-6, -10e-6)
        rig.advance(3)
        before = rig.last("x")["skew_command_v"]
        rig.driver.status[1] = Status.STALE
        rig.put(90e-6, -90e-6)
        rig.advance(2)
        assert rig.last("x")["skew_command_v"] == before
        rig.driver.status[1] = 0
        rig.put(30e-6, -10e-6)
        rig.advance(1)
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.last("x")["skew_m"] == pytest.approx(40e-6)


# What stops both


def test_too_much_skew_takes_both_motors_off_within_the_tick():
    with Held(guards={"skew": {"limit_m": 0.3e-3}}) as rig:
        rig.put(0.14e-3, -0.14e-3)
        rig.advance(1)
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.driver.enable.tolist() == [1, 1]
        rig.put(0.16e-3, -0.16e-3)
        rig.advance(1)
        assert rig.driver.volts.tolist() == [0.0, 0.0]
        assert rig.driver.enable.tolist() == [0, 0]
        assert rig.fault_of("x") is FaultCause.SKEW
        assert "ahead of the second by 0.32 mm, limit 0.3 mm" in told(rig)


def test_one_damaged_sample_of_one_end_is_left_out_where_the_model_stands_in_two_are_not():
    with Held(predict=True, guards={"skew": {"limit_m": 0.3e-3}}, limits=IN_PHASE) as rig:
        rig.advance(5)
        rig.put(0.0, 0.5e-3)
        rig.advance(1)
        rig.put(0.0, 0.0)
        rig.advance(100)
        assert rig.state_of("x") is AxisState.IDLE
        rig.put(0.0, 0.5e-3)
        rig.advance(2)
        assert rig.fault_of("x") is FaultCause.SKEW


@pytest.mark.slow
def test_a_beam_on_a_slower_driver_keeps_its_commands_between_its_ticks():
    machine = absolute(beam(), 50e-6)
    setup = machine.axes["x"].model_copy(update={"divisor": 5})
    with Rig(dataclasses.replace(machine, axes={"x": setup})) as rig:
        rig.start()
        rig.move("x", 0.25)
        rig.seconds(0.9)
        rig.raise_faults()
        rows = rig.rows("x")
        between = (rows["flags"] & SampleFlag.BETWEEN) != 0
        assert between.mean() == pytest.approx(0.8, abs=0.01)
        assert not np.diff(rows["skew_command_v"])[between[1:]].any()
        assert abs(rows["position_m"][-1] - 0.25) < 5e-6
        assert abs(rows["skew_m"][-1]) < 5e-6


def test_a_quick_stop_on_skew_ramps_down_and_lets_go_where_it_grows_on():
    guards = {"skew": {"limit_m": 0.3e-3, "reaction": "quick_stop"}}
    with Held(guards=guards, limits=IN_PHASE) as rig:
        rig.move("x", 0.1)
        rig.seconds(0.01)
        rig.put(0.16e-3, -0.16e-3)
        rig.advance(1)
        assert rig.state_of("x") is AxisState.STOPPING
        assert rig.driver.enable.tolist() == [1, 1]
        rig.put(0.31e-3, -0.31e-3)
        rig.advance(1)
        assert rig.fault_of("x") is FaultCause.SKEW
        assert rig.state_of("x") is AxisState.FAULT
        assert rig.driver.enable.tolist() == [0, 0]


def test_a_beam_further_askew_than_may_be_squared_is_not_started():
    with Rig(absolute(with_dual(beam(), max_out_of_square_m=None), 1.2e-3)) as rig:
        rig.order(Verb.START, "x")
        assert rig.fault_of("x") is FaultCause.SKEW
        assert rig.state("x")["fault_limit"] == 1e-3
        assert not rig.rows("x")["skew_command_v"].any()


def test_an_encoder_that_sticks_at_one_end_trips_on_skew():
    fault = {"kind": "encoder_stuck", "at_s": 0.3, "channel": 1}
    with Rig(on_plant(absolute(beam()), faults=[fault])) as rig:
        rig.start()
        rig.move("x", 0.3)
        rig.seconds(1.0)
        assert rig.fault_of("x") is FaultCause.SKEW
        rows = rig.rows("x")
        enabled = rows["state"] == AxisState.RUNNING
        # 0.5 m/s pass the limit of 1 mm within 10 ticks.
        assert np.abs(rows["skew_m"][enabled]).max() <= 1e-3
        assert 0.301 < rig.state("x")["fault_time_s"] < 0.304


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize(
    ("kind", "cause"),
    [
        ("encoder_lost", FaultCause.ENCODER_LOST),
        ("amplifier_fault", FaultCause.AMPLIFIER),
        ("estop", FaultCause.ESTOP),
        ("communication_lost", FaultCause.COMMUNICATION),
    ],
)
def test_what_one_end_reports_takes_both_motors_off_within_the_tick(kind, cause, end):
    bit = {
        "encoder_lost": Status.ENCODER_LOST,
        "amplifier_fault": Status.AMPLIFIER_FAULT,
        "estop": Status.ESTOP,
        "communication_lost": Status.COMMUNICATION_LOST,
    }[kind]
    with Held() as rig:
        rig.put(30e-6, -30e-6)
        rig.advance(2)
        assert rig.driver.enable.tolist() == [1, 1]
        rig.driver.status[end] = bit
        rig.advance(1)
        assert rig.driver.enable.tolist() == [0, 0]
        assert rig.driver.volts.tolist() == [0.0, 0.0]
        assert rig.fault_of("x") is cause
        assert rig.last("x")["second_device_status"] == (bit if end else 0)
        assert rig.last("x")["device_status"] == bit
        assert f", at the {('first', 'second')[end]} end of the beam" in told(rig)


def test_the_error_codes_of_two_ends_are_not_mixed_into_a_third():
    with Held() as rig:
        for end, code in enumerate((0x2310, 0x4210)):
            rig.driver.status[end] = int(Status.AMPLIFIER_FAULT) | error_bits(code)
        rig.advance(1)
        assert "error 2310h" in told(rig)


@pytest.mark.parametrize("end", [0, 1])
def test_a_jump_of_one_encoder_takes_both_motors_off(end):
    with Held() as rig:
        rig.advance(2)
        rig.driver.counts[end] += 10_000  # 5 mm
        rig.advance(1)
        assert rig.fault_of("x") is FaultCause.ENCODER_JUMP
        assert f", at the {('first', 'second')[end]} end of the beam" in told(rig)
        assert rig.driver.enable.tolist() == [0, 0]


def test_a_command_that_is_no_number_takes_both_motors_off():
    with Held() as rig:
        rig.tick.dual_settings["ks_v_s_m"] = math.nan
        rig.advance(1)
        assert rig.fault_of("x") is FaultCause.NOT_A_NUMBER
        assert rig.driver.volts.tolist() == [0.0, 0.0]
        assert rig.driver.enable.tolist() == [0, 0]


def test_skipped_periods_do_not_upset_the_skew_loop():
    with Hand(absolute(beam())) as hand:
        hand.step()
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(500)
        for _ in range(50):
            hand.step(elapsed=7)
            hand.step()
        assert AxisState(int(hand.status()["state"])) is AxisState.IDLE
        assert abs(hand.status()["skew_m"]) < 5e-6
