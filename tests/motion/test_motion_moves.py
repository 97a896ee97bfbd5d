"""Promises of point-to-point moves and of the published back and forth."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from motion_bounds import assert_at_rest_at_both_ends, assert_continuous, assert_within

from motorctl.errors import UsageError
from motorctl.motion import BackAndForth, PointToPoint, Trajectory, point_to_point
from motorctl.motion.back_and_forth import smoothed_trapezoid

positions = st.floats(-2, 2)
velocities = st.floats(1e-3, 5)
accelerations = st.floats(1e-2, 100)
jerks = st.floats(1, 1e5)
times = st.floats(1e-4, 0.2)


@pytest.mark.slow
@given(positions, positions, velocities, accelerations, jerks)
@settings(max_examples=300)
def test_a_move_keeps_its_limits_and_ends_exactly(start, target, velocity, acceleration, jerk):
    move = point_to_point(start, target, velocity, acceleration, jerk)
    assert move.start_m == pytest.approx(start, rel=0, abs=1e-12)
    assert move.end_m == pytest.approx(target, rel=0, abs=1e-15 * max(1, abs(target), abs(start)))
    assert_within(move, velocity, acceleration, jerk)
    assert_continuous(move)
    assert_at_rest_at_both_ends(move)
    low, high = move.peaks().range_m
    assert low >= min(start, target) - 1e-12
    assert high <= max(start, target) + 1e-12


def test_a_long_move_takes_the_time_of_the_seven_phases():
    # d/v + v/a + a/j, where both limits are reached.
    move = point_to_point(0.1, 0.5, 1.0, 10.0, 500.0)
    assert move.duration_s == pytest.approx(0.4 / 1.0 + 1.0 / 10 + 10 / 500.0, rel=1e-12)
    assert move.peaks().max_velocity_m_s == pytest.approx(1.0, rel=1e-12)


def test_a_tiny_move_takes_the_time_of_four_jerk_phases():
    # d = 2 j t^3 for four phases of length t.
    move = point_to_point(0.0, -1e-6, 1.0, 10.0, 500.0)
    assert move.duration_s == pytest.approx(4 * (1e-6 / (2 * 500)) ** (1 / 3), rel=1e-9)


@given(st.tuples(st.floats(-11, 3), st.floats(-5, 2), st.floats(-4, 4), st.floats(-1, 8)))
@settings(max_examples=100)
def test_a_move_can_be_planned_over_any_distance_and_with_any_limits(exponents):
    distance, velocity, acceleration, jerk = (10.0**exponent for exponent in exponents)
    move = point_to_point(0.0, distance, velocity, acceleration, jerk)
    assert move.end_m == pytest.approx(distance, rel=1e-14)
    assert_within(move, velocity, acceleration, jerk)


def test_a_move_to_where_it_is_takes_no_time():
    move = point_to_point(0.3, 0.3, 1.0, 10.0, 500.0)
    assert (move.duration_s, move.start_m, move.end_m) == (0.0, 0.3, 0.3)


def test_impossible_limits_of_a_move_are_told():
    with pytest.raises(UsageError, match=r"no move from 0 to 1 m with at most 0 m/s"):
        point_to_point(0.0, 1.0, 0.0, 1.0, 1.0)
    with pytest.raises(UsageError, match=r"no move"):
        point_to_point(0.0, math.nan, 1.0, 1.0, 1.0)


def test_a_point_to_point_program_is_one_move():
    program = PointToPoint(
        name="there",
        axis="x",
        start_m=0.0,
        target_m=0.3,
        max_velocity_m_s=1.0,
        max_acceleration_m_s2=10.0,
        max_jerk_m_s3=500.0,
    )
    assert (program.axes, program.cycles, program.period_s) == (("x",), 1, None)
    assert program.trajectories()["x"].end_m == 0.3


@pytest.mark.slow
@given(positions, st.floats(-1, 1), velocities, accelerations, times)
@settings(max_examples=300)
def test_a_smoothed_trapezoid_keeps_its_limits_and_ends_exactly(
    start, distance, velocity, acceleration, jerk_time
):
    assume(abs(distance) > 1e-9)
    end = start + distance
    move = Trajectory(smoothed_trapezoid(start, end, velocity, acceleration, jerk_time))
    assert move.start_m == start
    assert move.end_m == pytest.approx(end, rel=0, abs=1e-15 * max(1, abs(start), abs(end)))
    assert_within(move, velocity, acceleration, acceleration / jerk_time)
    assert_continuous(move)
    assert_at_rest_at_both_ends(move)


def convolved(distance, velocity, acceleration, jerk_time, t):
    """Velocity of a trapezoid averaged over the last `jerk_time`, from its exact integral."""
    pulse = velocity / acceleration
    cruise_end = distance / velocity

    def position(time):
        ramp = np.clip(time, 0, pulse)
        brake = np.clip(time - cruise_end, 0, pulse)
        cruise = np.clip(time - pulse, 0, None) * velocity
        braked = np.clip(time - cruise_end - pulse, 0, None) * velocity
        return acceleration * (ramp**2 - brake**2) / 2 + cruise - braked

    return (position(t) - position(t - jerk_time)) / jerk_time


@pytest.mark.parametrize(
    ("velocity", "acceleration", "jerk_time"),
    [(1.05, 35.6, 0.0086), (0.95, 9.5, 0.017), (0.3, 30.0, 0.05)],
)
def test_the_move_is_the_trapezoid_convolved_with_a_box(velocity, acceleration, jerk_time):
    move = Trajectory(smoothed_trapezoid(0.0, 0.4, velocity, acceleration, jerk_time))
    t = np.linspace(0, move.duration_s, 5001)
    expected = convolved(0.4, velocity, acceleration, jerk_time, t)
    np.testing.assert_allclose(move.sample(t)[1], expected, atol=1e-12)
    assert move.duration_s == pytest.approx(
        0.4 / velocity + velocity / acceleration + jerk_time, rel=1e-12
    )


def test_a_move_too_short_for_its_velocity_runs_slower_and_keeps_its_acceleration():
    move = Trajectory(smoothed_trapezoid(0.0, 0.01, 5.0, 10.0, 0.005))
    peaks = move.peaks()
    # The pulses touch: d / v - v / a = Tj.
    v = peaks.max_velocity_m_s
    assert v < 5.0
    assert 0.01 / v - v / 10.0 == pytest.approx(0.005, rel=1e-9)
    assert peaks.max_acceleration_m_s2 == pytest.approx(10.0, rel=1e-12)
    assert peaks.max_jerk_m_s3 == pytest.approx(10.0 / 0.005, rel=1e-12)


def test_a_pulse_shorter_than_the_jerk_time_reaches_less_acceleration():
    move = Trajectory(smoothed_trapezoid(0.0, 0.4, 0.2, 50.0, 0.02))
    peaks = move.peaks()
    assert peaks.max_velocity_m_s == pytest.approx(0.2, rel=1e-12)
    assert peaks.max_acceleration_m_s2 == pytest.approx(0.2 / 0.02, rel=1e-12)
    assert peaks.max_jerk_m_s3 == pytest.approx(50.0 / 0.02, rel=1e-12)


def published(axis, velocity, acceleration, jerk_time, period, cycles=1):
    return BackAndForth(
        name="published",
        axis=axis,
        start_m=0.0,
        distance_m=0.4,
        max_velocity_m_s=velocity,
        max_acceleration_m_s2=acceleration,
        jerk_time_s=jerk_time,
        period_s=period,
        cycles=cycles,
    )


@pytest.mark.parametrize(
    ("axis", "velocity", "acceleration", "jerk_time", "period"),
    [("x", 1.05, 35.6, 0.0086, 3.5), ("y", 0.95, 9.5, 0.017, 4.0)],
)
def test_the_published_programs_have_their_published_numbers(
    axis, velocity, acceleration, jerk_time, period
):
    program = published(axis, velocity, acceleration, jerk_time, period, cycles=12)
    trajectory = program.trajectories()[axis]
    peaks = trajectory.peaks()
    assert peaks.max_velocity_m_s == pytest.approx(velocity, rel=1e-12)
    assert peaks.max_acceleration_m_s2 == pytest.approx(acceleration, rel=1e-12)
    assert peaks.max_jerk_m_s3 == pytest.approx(acceleration / jerk_time, rel=1e-12)
    assert peaks.range_m == pytest.approx((0.0, 0.4), abs=1e-15)
    assert trajectory.duration_s == pytest.approx(12 * period, rel=1e-13)
    assert (program.period_s, program.cycles) == (period, 12)
    # At rest at the far end halfway through each period, back at its end.
    for cycle in range(12):
        x, v, a = trajectory.sample([(cycle + 0.5) * period - 1e-6, (cycle + 1) * period - 1e-6])
        np.testing.assert_array_equal(x, [0.4, 0.0])
        np.testing.assert_array_equal(np.concatenate([v, a]), 0.0)
    assert_continuous(trajectory)


def test_both_ways_are_mirror_images_half_a_period_apart():
    trajectory = published("x", 1.05, 35.6, 0.0086, 3.5).trajectories()["x"]
    t = np.linspace(0, 1.75, 2000)
    (x1, v1, a1), (x2, v2, a2) = trajectory.sample(t), trajectory.sample(t + 1.75)
    np.testing.assert_allclose(x1, 0.4 - x2, atol=1e-12)
    np.testing.assert_allclose(v1, -v2, atol=1e-10)
    np.testing.assert_allclose(a1, -a2, atol=1e-8)


def test_a_period_with_just_enough_time_has_no_dwell():
    move_s = 0.4 / 1.05 + 1.05 / 35.6 + 0.0086
    trajectory = published("x", 1.05, 35.6, 0.0086, 2 * move_s + 1e-12).trajectories()["x"]
    assert trajectory.duration_s == pytest.approx(2 * move_s)
    assert_continuous(trajectory)
