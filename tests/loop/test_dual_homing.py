"""Both ends of a beam home to their own switch or mark, and the beam is squared by them."""

import numpy as np
import pytest
from beam_bench import RESOLUTION_M, beam, home, on_plant, with_dual
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import TS, Rig, with_axes

from motorctl.daemon.axis_faults import faults_of
from motorctl.errors import RunError
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb

ONE_TICK_M = 0.005 * TS
EDGES_M = (-0.08, -0.0804)
"""Where the shipped beam's home switches open; the beam is square with the first 0.4 mm ahead."""


def machine(*, homing=None, **options):
    return with_axes(on_plant(beam(), **options), ["x"], homing=homing or {})


def square_error_m(rig) -> float:
    """Return how far the true beam is from square."""
    true = rig.driver.true_state().position_m
    return float(true[0] - true[1])


def mean_error_m(rig) -> float:
    """Return how far the position that the axis believes is from the true one."""
    return float(rig.last("x")["position_m"] - rig.driver.true_state().position_m.mean())


STARTS = {
    "off the switches": (0.03, 0.0297),
    "far askew": (0.03, 0.0288),
    "on both": (-0.09, -0.0903),
    "on one": (-0.0799, -0.0812),
}


@pytest.mark.parametrize("places", STARTS.values(), ids=STARTS.keys())
@pytest.mark.parametrize("latch", [0.005, -0.005], ids=["leaving", "coming"])
def test_homing_squares_a_beam_by_its_two_switches(places, latch):
    plants = {k: {"initial_position_m": place} for k, place in enumerate(places)}
    with Rig(machine(plants=plants, homing={"latch_velocity_m_s": latch})) as rig:
        home(rig)
        rig.raise_faults()
        assert rig.state("x")["homed"]
        rig.seconds(1.0)
        assert abs(square_error_m(rig)) <= ONE_TICK_M + 4 * RESOLUTION_M
        assert abs(mean_error_m(rig)) <= ONE_TICK_M + 4 * RESOLUTION_M
        assert rig.last("x")["skew_reference_m"] == 0.0
        assert abs(rig.last("x")["skew_m"]) <= 4 * RESOLUTION_M


def test_the_ends_are_not_pulled_apart_while_they_search():
    with Rig(machine()) as rig:
        home(rig)
        rows = rig.rows("x")
        searching = rows[rows["state"] == AxisState.HOMING]
        assert np.abs(searching["skew_m"] - searching["skew_reference_m"]).max() < 50e-6
        assert np.ptp(searching["skew_reference_m"]) == 0.0


def test_homing_by_index_takes_each_ends_own_mark():
    ends = {
        0: {"encoder": {"index_marks_m": [-0.07]}},
        1: {"encoder": {"index_marks_m": [-0.0707]}},
    }
    homing = {"method": "switch_index", "home_position_m": -0.07035}
    marked = with_dual(machine(plants=ends, homing=homing), square_offset_m=0.7e-3)
    with Rig(marked) as rig:
        home(rig)
        rig.seconds(0.8)
        rig.raise_faults()
        assert abs(square_error_m(rig)) <= 4 * RESOLUTION_M
        assert abs(mean_error_m(rig)) <= 2 * RESOLUTION_M


@pytest.mark.parametrize(
    ("apart_m", "limit"),
    [(0.0026, "limit 2.4 mm"), (-0.0022, "by -2.5 mm, limit 2 mm")],
    ids=["one is waited for in vain", "both are found"],
)
def test_switches_that_are_too_far_apart_are_a_fault_that_says_so(apart_m, limit):
    moved = machine(plants={1: {"home_switch": {"to_m": EDGES_M[1] - apart_m}}})
    with Rig(moved) as rig:
        home(rig)
        assert rig.fault_of("x") is FaultCause.NOT_SQUARE
        assert not rig.state("x")["homed"]
        message = faults_of(rig.machine, rig.memory.axis_status)["x"]["message"]
        assert "by the switches or marks of its two ends the beam is out of square" in message
        assert limit in message


@pytest.mark.parametrize("end", [0, 1])
def test_a_switch_that_never_closes_stops_the_beam_soon_after_the_other(end):
    with Rig(machine(plants={end: {"home_switch": {"from_m": 0.49, "to_m": 0.5}}})) as rig:
        home(rig)
        assert rig.fault_of("x") is FaultCause.NOT_SQUARE
        # The other's edge, what is allowed, and what a tick at 0.05 m/s moves.
        rows = rig.rows("x")
        moving = rows[rows["state"] == AxisState.HOMING]
        went = moving["position_m"][0] - moving["position_m"][-1]
        assert went < 0.03 + 0.0804 + 0.0024 + 0.0005


def test_homing_again_finds_the_same_square():
    with Rig(machine()) as rig:
        home(rig)
        rig.seconds(0.5)
        first = rig.driver.true_state().position_m
        home(rig)
        rig.seconds(0.5)
        rig.raise_faults()
        again = rig.driver.true_state().position_m
        assert abs(np.diff(again - first)[0]) <= 2 * ONE_TICK_M + 4 * RESOLUTION_M


def test_an_unsquared_beam_is_held_as_it_stands_and_may_not_run_a_program():
    with Rig(machine()) as rig:
        rig.order(Verb.START, "x")
        rig.seconds(0.3)
        assert rig.last("x")["skew_reference_m"] == pytest.approx(0.0, abs=20e-6)
        assert abs(square_error_m(rig) - 0.3e-3) < 60e-6
        with pytest.raises(RunError, match="not homed"):
            rig.order(Verb.FOLLOW, "x")
        assert rig.ask(Verb.STOP) is Reply.OK


@settings(max_examples=6)
@given(askew_m=st.floats(-1.5e-3, 1.5e-3), ahead_m=st.floats(-1e-3, 1e-3), seed=st.integers(0, 99))
def test_homing_squares_however_the_beam_stands_and_the_switches_lie(askew_m, ahead_m, seed):
    plants = {
        0: {"initial_position_m": -0.05 + 0.5 * askew_m},
        1: {"initial_position_m": -0.05 - 0.5 * askew_m, "home_switch": {"to_m": -0.08 - ahead_m}},
    }
    homing = {"home_position_m": -0.08 - 0.5 * ahead_m}
    homed = with_dual(machine(plants=plants, homing=homing, seed=seed), square_offset_m=ahead_m)
    with Rig(homed) as rig:
        home(rig)
        rig.seconds(1.2)
        rig.raise_faults()
        assert abs(square_error_m(rig)) <= ONE_TICK_M + 4 * RESOLUTION_M
        assert abs(mean_error_m(rig)) <= ONE_TICK_M + 4 * RESOLUTION_M
