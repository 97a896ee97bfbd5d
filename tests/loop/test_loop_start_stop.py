"""Starting gives no bump, stopping keeps its limits, and neither remembers what it should not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import TS, Rig, Still, gantry, with_axes, with_driver, with_sim

from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import point_to_point

COUNT_V = 0.27
"""What a count of the encoder is worth: ks (1/Ts + k1) times 0.5 um."""


def stopped_on_the_way(after_s: float, **limits) -> tuple[np.ndarray, int, Rig]:
    """Stop x some time into a quick move; gives its rows and the first of the stop."""
    machine = with_axes(with_sim(gantry()), limits=limits)
    rig = Rig(machine)
    with rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 1.0, 30.0, 5000.0)})
        rig.seconds(after_s)
        rig.order(Verb.STOP, "x")
        rig.seconds(0.5)
    rows = rig.rows("x")
    return rows, int(np.argmax(rows["state"] == AxisState.STOPPING)), rig


@settings(max_examples=15)
@given(st.floats(0.005, 0.42))
def test_a_stop_ramps_down_within_its_limits_and_ends_off(after_s):
    acceleration, jerk = 10.0, 1000.0
    rows, first, rig = stopped_on_the_way(after_s)
    assert rig.state_of("x") is AxisState.OFF
    assert rig.fault_of("x") is FaultCause.NONE
    assert rig.driver.true_state().velocity_m_s[0] == pytest.approx(0.0, abs=1e-3)
    ramp = rows[first - 1 :][: int(np.argmax(rows["state"][first:] == AxisState.OFF)) + 1]
    a, v = ramp["reference_acceleration_m_s2"], ramp["reference_velocity_m_s"]
    begun = abs(a[0])
    # A program may accelerate more than a stop: it comes back to the stop's limit at the jerk.
    assert np.abs(a).max() <= max(acceleration, begun) * (1 + 1e-9)
    assert np.abs(np.diff(a)).max() <= jerk * TS * (1 + 1e-6)
    assert np.abs(np.diff(v)).max() <= max(acceleration, begun) * TS * (1 + 1e-6)
    assert np.abs(np.diff(ramp["reference_m"])).max() <= np.abs(v).max() * TS * (1 + 1e-6)
    assert np.abs(ramp["following_error_m"]).max() < 1e-3
    off = rows[first:][rows["state"][first:] == AxisState.OFF]
    assert (off["command_v"] == 0.0).all()
    assert (off["d0_hat_v"] == 0.0).all()


def test_a_stop_while_stopping_changes_nothing():
    rows, first, _ = stopped_on_the_way(0.2)
    with Rig(with_sim(gantry())) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 1.0, 30.0, 5000.0)})
        rig.seconds(0.2)
        rig.order(Verb.STOP, "x")
        rig.order(Verb.STOP, "x")
        rig.seconds(0.3)
        again = rig.rows("x")[first : first + 1000]
        assert (again["reference_m"] == rows["reference_m"][first : first + 1000]).all()


def test_a_fault_while_stopping_zeroes_the_voltage():
    with Rig(with_sim(gantry())) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 1.0, 30.0, 5000.0)})
        rig.seconds(0.2)
        rig.order(Verb.STOP, "x")
        rig.advance(5)
        assert rig.state_of("x") is AxisState.STOPPING
        rig.order(Verb.ESTOP, "x")
        assert rig.fault_of("x") is FaultCause.ESTOP
        assert rig.last("x")["command_v"] == 0.0


@pytest.mark.parametrize("offset", [-0.45, 0.0, 0.3])
def test_starting_gives_no_bump_whatever_was_learned(offset):
    theta = [0.19, 0.25, 0.1, offset, -0.005, -0.0005]
    plant = {"offset_v": offset, "presliding": None}
    rig = Rig(with_sim(gantry(), plants={0: plant}), learned={"x": theta})
    with rig:
        rig.advance(10)
        rig.order(Verb.START, "x")
        rig.advance(50)
        rows = rig.rows("x")
        enabled = rows[rows["state"] == AxisState.IDLE]
        assert enabled["command_v"][0] == 0.0
        # What has to be held against grows with the fast adaptation; there is no step.
        assert np.abs(enabled["command_v"]).max() < abs(offset) + 2 * COUNT_V
        assert np.abs(enabled["following_error_m"]).max() < 20e-6


def test_starting_after_a_stop_forgets_the_motion_but_not_the_estimate():
    with Rig(with_sim(gantry())) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 1.0, 30.0, 5000.0)})
        rig.seconds(0.3)
        rig.order(Verb.STOP, "x")
        rig.seconds(0.5)
        theta = rig.last("x")["theta_hat"].copy()
        assert (theta != rig.rows("x")["theta_hat"][0]).any()
        rig.order(Verb.START, "x")
        assert (rig.last("x")["theta_hat"] == theta).all()
        assert rig.last("x")["command_v"] == 0.0
        rig.seconds(0.1)
        assert np.abs(rig.rows("x")["command_v"][-400:]).max() < 2 * COUNT_V
        assert rig.last("x")["reference_m"] == rig.rows("x")["reference_m"][-400]


def test_starting_after_a_fault_begins_from_where_the_axis_came_to_rest():
    fault = {"kind": "amplifier_fault", "at_s": 0.2, "duration_s": 0.1, "channel": 0}
    with Rig(with_sim(gantry(), faults=[fault])) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 0.3, 10.0, 2000.0)})
        rig.seconds(1.5)  # coasts to rest
        assert rig.fault_of("x") is FaultCause.AMPLIFIER
        assert rig.ask(Verb.RESET) is Reply.OK
        assert rig.ask(Verb.START) is Reply.OK
        assert rig.last("x")["command_v"] == 0.0
        assert rig.last("x")["following_error_m"] == 0.0
        rig.seconds(0.2)
        assert rig.state_of("x") is AxisState.IDLE
        assert np.abs(rig.rows("x")["following_error_m"][-500:]).max() < 5e-6


def test_an_axis_that_is_off_is_watched_but_never_driven():
    rig = Rig(with_driver(gantry(), Still))
    rig.tick.open(virtual=True)
    for k in range(100):
        rig.driver.counts[:] = 100 * k
        rig.advance(1)
    rows = rig.rows("x")
    assert (rows["command_v"] == 0.0).all()
    assert rig.driver.enable.tolist() == [0, 0]
    assert rows["position_m"][-1] == pytest.approx(99 * 100 * 0.5e-6)
    assert rows["velocity_m_s"][-1] == pytest.approx(100 * 0.5e-6 / TS)
    assert (rows["following_error_m"] == 0.0).all()


def test_leaving_the_machine_makes_the_outputs_safe():
    rig = Rig(with_driver(gantry(), Still))
    with rig:
        rig.start()
        rig.driver.counts[:] = 3
        rig.advance(3)
        assert rig.driver.enable.tolist() == [1, 1]
    assert rig.driver.enable.tolist() == [0, 0]
    assert rig.driver.volts.tolist() == [0.0, 0.0]
    assert rig.driver.calls == ["open", "safe", "close"]
