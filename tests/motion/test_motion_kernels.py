"""Promises of the compiled kernels: playback of tables, and the ramp of velocity."""

import math

import numpy as np
import pytest
import ruckig
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from motorctl.motion import (
    SEGMENT,
    BackAndForth,
    Circle,
    Trajectory,
    advance,
    evaluate,
    point_to_point,
    velocity_ramp_step,
)

TS = 2e-4


def play(trajectory, dt, room=5):
    """Follow a table that lies in a larger one, tick by tick, until it is done."""
    count = len(trajectory.segments)
    table = np.full(count + room, np.nan, SEGMENT)
    table[:count] = trajectory.segments
    index, s, done = 0, 0.0, False
    states = [evaluate(table, count, index, s)]
    while not done:
        index, s, done = advance(table, count, index, s, dt)
        assert 0 <= index < count
        states.append(evaluate(table, count, index, s))
    return np.array(states).T, (index, s)


def published_x():
    return BackAndForth(
        name="published",
        axis="x",
        start_m=0.0,
        distance_m=0.4,
        max_velocity_m_s=1.05,
        max_acceleration_m_s2=35.6,
        jerk_time_s=0.0086,
        period_s=3.5,
        cycles=2,
    ).trajectories()["x"]


def ring_y():
    return Circle(
        name="ring",
        axes=("x", "y"),
        center_m=(0.2, 0.1),
        radius_m=0.05,
        speed_m_s=0.3,
        max_acceleration_m_s2=5,
        max_jerk_m_s3=500,
    ).trajectories()["y"]


@pytest.mark.parametrize(
    "trajectory",
    [published_x(), ring_y(), point_to_point(0.0, 0.1, 1.0, 20.0, 1e4), Trajectory.at_rest(0.3, 1)],
    ids=["back_and_forth", "circle", "point_to_point", "rest"],
)
@pytest.mark.parametrize("dt", [TS, 1e-3, 0.05])
def test_playback_gives_what_the_trajectory_samples(trajectory, dt):
    (x, v, a), _ = play(trajectory, dt)
    ticks = np.arange(len(x)) * dt
    assert trajectory.duration_s <= ticks[-1] + 1e-9 <= trajectory.duration_s + dt + 2e-9
    xs, vs, accelerations = trajectory.sample(ticks)
    # Times add up with rounding, which acceleration sees times the jerk.
    np.testing.assert_allclose(x, xs, rtol=0, atol=1e-11)
    np.testing.assert_allclose(v, vs, rtol=0, atol=1e-9)
    np.testing.assert_allclose(a, accelerations, rtol=0, atol=1e-6)


def test_playback_ends_at_the_exact_end_and_stays_there():
    trajectory = point_to_point(0.0, 0.123456789, 1.0, 20.0, 1e4)
    table, count = trajectory.segments, len(trajectory.segments)
    index, s, done = advance(table, count, 0, 0.0, 1e3)
    assert (index, s, done) == (count - 1, table["duration_s"][-1], True)
    assert evaluate(table, count, index, s)[0] == trajectory.end_m
    assert advance(table, count, index, s, TS) == (index, s, True)


def test_a_trajectory_without_duration_is_done_at_once():
    rest = Trajectory.at_rest(0.2)
    assert advance(rest.segments, 1, 0, 0.0, TS) == (0, 0.0, True)
    assert evaluate(rest.segments, 1, 0, 0.0) == (0.2, 0.0, 0.0)


def test_an_index_outside_the_table_gives_its_nearest_end():
    trajectory = point_to_point(0.1, 0.2, 1.0, 20.0, 1e4)
    table, count = trajectory.segments, len(trajectory.segments)
    assert evaluate(table, count, count + 3, 0.0)[0] == trajectory.end_m
    assert evaluate(table, count, -1, -1.0) == (0.1, 0.0, 0.0)


def ramp_down(v, a, target, acceleration, jerk, dt=TS, most=400_000):
    """Step until the target is reached; gives the states and the way at every tick."""
    states, way = [(v, a)], [0.0]
    while not (v == target and a == 0.0):
        v, a, dx = velocity_ramp_step(v, a, target, acceleration, jerk, dt)
        states.append((v, a))
        way.append(way[-1] + dx)
        assert len(states) < most, "never arrives"
    return np.array(states), np.array(way)


def by_ruckig(v, a, target, acceleration, jerk):
    """Plan the same change with ruckig's velocity interface -> (duration, distance)."""
    request = ruckig.InputParameter(1)
    request.control_interface = ruckig.ControlInterface.Velocity
    request.current_position, request.current_velocity = [0.0], [v]
    request.current_acceleration = [a]
    request.target_velocity, request.target_acceleration = [target], [0.0]
    request.max_acceleration, request.max_jerk = [acceleration], [jerk]
    plan = ruckig.Trajectory(1)
    assert ruckig.Ruckig(1).calculate(request, plan) == ruckig.Result.Working
    (x,), _, _ = plan.at_time(plan.duration)
    return plan.duration, x


ramps = {
    "v": st.floats(-2, 2),
    "share": st.floats(-2, 2),
    "target": st.floats(-2, 2) | st.just(0.0),
    "acceleration": st.floats(0.5, 50),
    "jerk": st.floats(20, 5e4),
}


@given(**ramps)
@settings(max_examples=300)
def test_the_ramp_takes_the_time_and_the_way_that_ruckig_plans(
    v, share, target, acceleration, jerk
):
    a = share * acceleration
    duration, distance = by_ruckig(v, a, target, acceleration, jerk)
    assume(duration > 1e-6)
    # One step as long as the whole way, and the whole way in ticks.
    v_end, a_end, dx = velocity_ramp_step(v, a, target, acceleration, jerk, duration + 1e-9)
    assert (v_end, a_end) == (target, 0.0)
    assert dx == pytest.approx(distance + 1e-9 * target, abs=1e-9)
    dt = duration / 37.3
    states, way = ramp_down(v, a, target, acceleration, jerk, dt)
    ticks = len(states) - 1
    assert ticks == 38
    assert way[-1] == pytest.approx(distance + (ticks * dt - duration) * target, abs=1e-8)


@given(**ramps)
@settings(max_examples=200)
def test_the_ramp_never_leaves_its_limits_nor_chatters(v, share, target, acceleration, jerk):
    a = share * acceleration
    states, _ = ramp_down(v, a, target, acceleration, jerk)
    accelerations = states[:, 1]
    jerks = np.diff(accelerations) / TS
    assert np.abs(jerks).max(initial=0) <= jerk * (1 + 1e-6) + 1e-6
    beyond = np.abs(accelerations) > acceleration * (1 + 1e-9)
    if beyond.any():
        # Only while it comes back, without a detour.
        last = int(np.flatnonzero(beyond).max())
        assert beyond[: last + 1].all()
        assert (np.diff(np.abs(accelerations[: last + 1])) < 0).all()
    # The time-optimal jerk changes its sign once, or twice where it first comes back to the limit.
    signs = np.sign(jerks[np.abs(jerks) > 1e-3 * jerk])
    assert np.count_nonzero(np.diff(signs)) <= (2 if abs(share) > 1 else 1)


@given(st.floats(-2, 2), st.floats(0.5, 50), st.floats(20, 5e4))
@settings(max_examples=100)
def test_a_stop_from_steady_motion_neither_turns_back_nor_overshoots(v, acceleration, jerk):
    states, way = ramp_down(v, 0.0, 0.0, acceleration, jerk)
    speed = states[:, 0] * math.copysign(1, v)
    assert (np.diff(speed) <= 1e-12).all()
    assert (speed >= -1e-12).all()
    assert (np.diff(way) * math.copysign(1, v) >= -1e-15).all()


def test_a_stop_from_one_metre_a_second_takes_the_analytic_time_and_way():
    # v/a + a/j seconds, at the mean velocity v/2.
    states, way = ramp_down(1.0, 0.0, 0.0, 10.0, 1000.0, dt=1e-3)
    assert len(states) - 1 == pytest.approx((1.0 / 10 + 10 / 1000) * 1000, abs=1)
    assert way[-1] == pytest.approx(0.11 / 2, abs=1e-14)


def test_a_finished_ramp_stays_put_to_the_bit():
    assert velocity_ramp_step(0.0, 0.0, 0.0, 10.0, 1000.0, TS) == (0.0, 0.0, 0.0)
    assert velocity_ramp_step(-0.02, 0.0, -0.02, 10.0, 1000.0, TS) == (-0.02, 0.0, -0.02 * TS)


def test_the_target_may_change_on_the_way():
    v, a, x = 0.0, 0.0, 0.0
    for tick in range(5000):
        target = 0.5 if tick < 300 else 0.0
        before = a
        v, a, dx = velocity_ramp_step(v, a, target, 10.0, 1000.0, TS)
        x += dx
        assert abs(a - before) <= 1000.0 * TS * (1 + 1e-9)
    assert (v, a) == (0.0, 0.0)
    assert x > 0
