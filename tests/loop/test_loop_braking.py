"""A stop at any moment ends at rest, within the travel, without turning back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import Rig, Still, gantry, with_axes, with_driver, with_sim

from motorctl.log.sample import AxisState
from motorctl.loop import Reply, Verb
from motorctl.loop.plan import plan_move


def stopped_after(rig: Rig, axis: str, seconds: float) -> np.ndarray:
    """Stop a moving axis after a while; gives the rows from the stop on."""
    rig.seconds(seconds)
    rig.chunks.clear()
    rig.order(Verb.STOP, axis)
    rig.wait_until(lambda: rig.state_of(axis) in (AxisState.OFF, AxisState.FAULT), 5.0)
    return rig.rows(axis)


def check_braking(rig: Rig, rows: np.ndarray, axis: str) -> None:
    limits = rig.machine.axes[axis].limits
    stopping = rows[rows["state"] == AxisState.STOPPING]
    assert rig.state_of(axis) is AxisState.OFF
    v = stopping["reference_velocity_m_s"]
    assert len(v) == 0 or (v >= -1e-9).all() or (v <= 1e-9).all(), "it turned back"
    low, high = limits.travel_m
    assert (stopping["reference_m"] >= low - 1e-9).all()
    assert (stopping["reference_m"] <= high + 1e-9).all()
    a = stopping["reference_acceleration_m_s2"]
    assert np.abs(a).max(initial=0.0) <= limits.max_acceleration_m_s2 * (1 + 1e-9)


@settings(max_examples=25)
@given(st.floats(0.0, 0.6))
def test_a_fast_move_to_the_end_of_travel_can_be_stopped_at_any_moment(seconds: float) -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.follow({"x": plan_move(rig.machine, "x", 0.0, 0.45, 1.5, 38.0)})
        check_braking(rig, stopped_after(rig, "x", seconds), "x")


@pytest.mark.slow
@settings(max_examples=25)
@given(st.floats(0.0, 3.5), st.sampled_from(["x", "y"]))
def test_the_published_motion_can_be_stopped_at_any_moment(seconds: float, axis: str) -> None:
    with Rig(with_sim(gantry(), preset="published_gantry")) as rig:
        rig.order(Verb.START, axis)
        rig.follow_programs([f"published_{axis}"])
        check_braking(rig, stopped_after(rig, axis, seconds), axis)


def test_a_stop_with_room_uses_the_gentle_limits() -> None:
    with Rig(with_sim(gantry())) as rig:
        limits = rig.machine.axes["x"].limits
        rig.order(Verb.START, "x")
        rig.move("x", 0.4, 0.5)
        rows = stopped_after(rig, "x", 0.2)
        peak = np.abs(rows["reference_acceleration_m_s2"]).max()
        assert peak == pytest.approx(limits.stop.acceleration_m_s2, rel=0.6)
        assert peak <= limits.stop.acceleration_m_s2


def test_an_axis_that_still_moves_is_not_enabled() -> None:
    rig = Rig(with_driver(gantry(), Still))
    rig.tick.open(virtual=True)
    rig.advance(1)
    rig.driver.counts[:] += 200  # 0.5 m/s
    assert rig.ask(Verb.START, "x") is Reply.STILL_MOVING
    assert rig.state_of("x") is AxisState.OFF
    assert rig.ask(Verb.START, "x") is Reply.OK


def test_an_unsigned_absolute_counter_below_zero_is_read_as_near_the_travel() -> None:
    rig = Rig(with_axes(with_driver(gantry(), Still), ["x"], encoder={"counter_bits": 24}))
    rig.driver.counts[0] = 2**24 - 20_000  # -10 mm
    rig.tick.open(virtual=True)
    rig.advance(2)
    assert rig.last("x")["position_m"] == pytest.approx(-0.01)
