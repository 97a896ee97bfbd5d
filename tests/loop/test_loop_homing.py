"""Homing finds the true zero, by switch, by index mark, by both, and gives up where it cannot."""

import numpy as np
import pytest
from loop_bench import TS, Hand, Rig, Still, gantry, homed_by, with_axes, with_driver, with_sim

from motorctl.daemon.axis_faults import faults_of
from motorctl.errors import RunError
from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Reply, Verb

COUNT_M = 0.5e-6
RAMPS = {"limit_switch": {"reaction": "quick_stop"}}
EDGE_M, INDEX_M = -0.02, 0.0
"""Where the simulated gantry's home switch opens, and its index mark."""
ONE_TICK_M = 0.01 * TS
"""How far the axis travels in a tick while it latches."""


def machine(homing, *, axis_encoder=None, **plant):
    plant.setdefault("initial_position_m", 0.0731)
    plant["encoder"] = {"absolute": False, **plant.get("encoder", {})}
    simulated = with_sim(gantry(), plants={0: plant})
    return with_axes(simulated, ["x"], homing=homing, encoder=axis_encoder or {})


def home(rig: Rig) -> None:
    rig.order(Verb.HOME, "x")
    rig.wait_until(lambda: rig.state_of("x") is not AxisState.HOMING)


def error_of(rig: Rig) -> float:
    """Return how far the position that the axis believes is from the true one."""
    return float(rig.last("x")["position_m"] - rig.driver.true_state().position_m[0])


@pytest.mark.parametrize("initial", [0.0731, -0.0312], ids=["off the switch", "on the switch"])
@pytest.mark.parametrize(
    ("homing", "tolerance"),
    [
        (homed_by("switch", home_position_m=EDGE_M), ONE_TICK_M),
        (homed_by("switch", latch_velocity_m_s=-0.01, home_position_m=EDGE_M), ONE_TICK_M),
        (homed_by("switch_index", home_position_m=INDEX_M), 2 * COUNT_M),
        (homed_by("switch", search_velocity_m_s=-0.4, home_position_m=EDGE_M), ONE_TICK_M),
    ],
    ids=["leaving the edge", "coming to the edge", "index after the edge", "fast search"],
)
def test_homing_finds_the_true_position(homing, tolerance, initial):
    with Rig(machine(homing, initial_position_m=initial)) as rig:
        assert not rig.state("x")["homed"]
        home(rig)
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.state("x")["homed"]
        rig.seconds(0.1)
        assert abs(error_of(rig)) <= tolerance + COUNT_M
        assert rig.last("x")["flags"] & SampleFlag.HOMED


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize("bits", [14, 32])
def test_homing_by_the_index_alone_is_right_to_a_count_or_two(direction, bits):
    encoder = {"direction": direction, "counter_bits": bits}
    homing = homed_by("index", latch_velocity_m_s=-0.05, home_position_m=0.2)
    plant = {"encoder": {"reversed": direction < 0, "index_marks_m": [0.0123]}}
    with Rig(machine(homing, axis_encoder=encoder, **plant)) as rig:
        home(rig)
        rig.seconds(0.1)
        assert abs(error_of(rig) - (0.2 - 0.0123)) <= 2 * COUNT_M


def test_a_switch_that_is_run_over_is_met_again():
    # 0.4 m/s needs 16 mm to stop, the switch is pressed over 1 mm.
    narrow = {"home_switch": {"from_m": -0.021, "to_m": -0.020}}
    for latch in (0.01, -0.01):
        homing = homed_by(
            "switch", search_velocity_m_s=-0.4, latch_velocity_m_s=latch, home_position_m=EDGE_M
        )
        with Rig(machine(homing, **narrow)) as rig:
            home(rig)
            assert rig.state_of("x") is AxisState.IDLE
            assert abs(error_of(rig)) <= ONE_TICK_M + 2 * COUNT_M


def test_a_search_towards_the_positive_end_works_alike():
    homing = homed_by(
        "switch", search_velocity_m_s=0.1, latch_velocity_m_s=-0.01, home_position_m=0.4
    )
    with Rig(machine(homing, home_switch={"from_m": 0.4, "to_m": None})) as rig:
        home(rig)
        assert abs(error_of(rig)) <= ONE_TICK_M + 2 * COUNT_M


def test_the_reference_moves_without_a_jump_all_the_way():
    homing = homed_by("switch", search_velocity_m_s=-0.2, latch_velocity_m_s=-0.01)
    with Rig(machine(homing)) as rig:
        home(rig)
        rows = rig.rows("x")
        homing_rows = rows[rows["state"] == AxisState.HOMING]
        a, v = (homing_rows[f"reference_{name}"] for name in ("acceleration_m_s2", "velocity_m_s"))
        x = homing_rows["reference_m"]
        assert np.abs(a).max() <= 10.0 * (1 + 1e-9)
        assert np.abs(np.diff(a)).max() <= 1000.0 * TS * (1 + 1e-6)
        assert np.abs(np.diff(v)).max() <= 10.0 * TS * (1 + 1e-9)
        middle = 0.5 * (v[1:] + v[:-1]) * TS
        assert np.abs(np.diff(x) - middle).max() <= 1000.0 * TS**3
        assert np.abs(homing_rows["following_error_m"]).max() < 1e-4


def test_finding_the_zero_gives_no_bump():
    homing = homed_by("switch_index", home_position_m=0.3)
    with Rig(machine(homing)) as rig:
        home(rig)
        rig.seconds(0.1)
        rows = rig.rows("x")
        last = int(np.nonzero(rows["state"] == AxisState.HOMING)[0][-1])
        around = slice(last - 50, last + 200)
        assert abs(rows["position_m"][last + 2] - rows["position_m"][last - 1]) > 0.1
        assert np.abs(np.diff(rows["command_v"][around])).max() < 1.0
        assert np.abs(rows["following_error_m"][around]).max() < 10e-6
        assert np.abs(rows["velocity_m_s"][around]).max() < 0.02


def test_soft_limits_are_in_force_from_the_found_zero_on():
    homing = homed_by("switch", home_position_m=EDGE_M)
    with Rig(machine(homing)) as rig:
        home(rig)
        low, high = gantry().axes["x"].limits.travel_m
        slack = gantry().axes["x"].limits.following_error.minimum_m
        assert rig.tick.axes["soft_low_m"][0] == pytest.approx(low - slack)
        assert rig.tick.axes["soft_high_m"][0] == pytest.approx(high + slack)
        rig.move("x", 0.1)
        rig.seconds(1.0)
        assert rig.driver.true_state().position_m[0] == pytest.approx(0.1, abs=1e-5)


def test_a_machine_homes_what_needs_it_when_it_starts():
    with Rig(machine(homed_by("switch", home_position_m=EDGE_M))) as rig:
        rig.start()
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.state_of("y") is AxisState.IDLE
        assert abs(error_of(rig)) <= ONE_TICK_M + 2 * COUNT_M


def test_homing_again_finds_the_same_zero():
    with Rig(machine(homed_by("switch_index", home_position_m=INDEX_M))) as rig:
        home(rig)
        first = error_of(rig)
        home(rig)
        assert rig.state("x")["homed"]
        assert abs(error_of(rig) - first) <= 2 * COUNT_M


def test_homing_that_finds_no_switch_ends_in_a_fault_after_its_timeout():
    homing = homed_by("switch", search_velocity_m_s=-0.01, timeout_s=0.5)
    with Rig(machine(homing, home_switch=None)) as rig:
        home(rig)
        assert rig.fault_of("x") is FaultCause.HOMING_FAILED
        assert rig.state("x")["fault_time_s"] == pytest.approx(0.5, abs=3 * TS)
        assert not rig.state("x")["homed"]
        assert rig.last("x")["command_v"] == 0.0


@pytest.mark.parametrize("both", [False, True])
def test_an_axis_that_stands_on_the_limit_switch_ahead_fails_to_home_and_is_told_the_way_out(
    both,
):
    switch = Status.LIMIT_NEGATIVE | (Status.LIMIT_POSITIVE if both else 0)
    still = with_axes(gantry(), ["x"], homing=homed_by("switch"), guards=RAMPS)
    rig = Rig(with_driver(still, Still))
    rig.tick.open(virtual=True)
    rig.driver.status[0] = switch
    rig.advance(3)
    assert rig.ask(Verb.HOME) is Reply.OK
    rig.seconds(0.01)
    assert rig.state_of("x") is AxisState.FAULT
    assert rig.fault_of("x") is FaultCause.HOMING_FAILED  # a move, which it may not make, would
    message = faults_of(rig.machine, rig.memory.axis_status)["x"]["message"]
    assert "ran onto a limit switch" in message
    assert "push it off the limit switch by hand" in message


def test_homing_that_runs_into_a_limit_switch_ends_in_a_fault():
    homing = homed_by("switch", search_velocity_m_s=0.1, timeout_s=60.0)
    with Rig(machine(homing, initial_position_m=0.44)) as rig:
        home(rig)
        assert rig.fault_of("x") is FaultCause.HOMING_FAILED
        assert rig.last("x")["command_v"] == 0.0
        at_limit = rig.rows("x")["flags"] & SampleFlag.LIMIT_POSITIVE != 0
        rows = rig.rows("x")[at_limit]
        assert (rows["command_v"] == 0.0).all()


def test_a_failed_homing_is_told_where_a_machine_is_started():
    homing = homed_by("switch", search_velocity_m_s=-0.01, timeout_s=0.5)
    with Rig(machine(homing, home_switch=None)) as rig, pytest.raises(RunError, match="axis x"):
        rig.start()


def test_a_stop_interrupts_homing_and_leaves_the_axis_without_a_zero():
    with Rig(machine(homed_by("switch"))) as rig:
        rig.order(Verb.HOME, "x")
        rig.seconds(0.3)
        rig.order(Verb.STOP, "x")
        rig.seconds(0.3)
        assert rig.state_of("x") is AxisState.OFF
        assert not rig.state("x")["homed"]
        rig.order(Verb.START, "x")
        assert rig.ask(Verb.FOLLOW, slot=0) is Reply.NOT_HOMED


def test_homing_switches_an_axis_on_that_is_off():
    with Rig(machine(homed_by("switch"))) as rig:
        assert rig.ask(Verb.HOME) is Reply.OK
        assert rig.state_of("x") is AxisState.HOMING
        assert rig.last("x")["following_error_m"] == pytest.approx(0.0, abs=1e-6)


def test_skipped_periods_count_towards_the_timeout():
    homing = homed_by("switch", search_velocity_m_s=-0.01, timeout_s=0.5)
    with Hand(machine(homing, home_switch=None)) as hand:
        hand.step()
        hand.ask(Verb.HOME)
        while hand.status()["state"] == AxisState.HOMING:
            hand.steps(9)
            hand.step(5)
        assert hand.status()["fault"] == FaultCause.HOMING_FAILED
        assert hand.status()["fault_time_s"] == pytest.approx(0.5, abs=6 * TS)
