"""Promises of segment tables and trajectories."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_bounds import assert_continuous

from motorctl.errors import UsageError
from motorctl.motion import SEGMENT, Trajectory, point_to_point
from motorctl.motion.segments import hermite_segments

coefficient = st.floats(-10, 10).filter(lambda c: c == 0 or abs(c) > 1e-6)


def single(duration, *coefficients):
    segments = np.zeros(1, SEGMENT)
    segments["duration_s"] = duration
    segments["c"][0, : len(coefficients)] = coefficients
    return Trajectory(segments)


@pytest.mark.slow
@given(st.lists(coefficient, min_size=6, max_size=6), st.floats(0.01, 3))
@settings(max_examples=200)
def test_peaks_bound_a_dense_sampling_and_are_met_by_it(coefficients, duration):
    trajectory = single(duration, *coefficients)
    peaks = trajectory.peaks()
    u = np.linspace(0, duration, 4001)
    c = np.polynomial.Polynomial(coefficients)
    signals = [c(u), *(c.deriv(n)(u) for n in (1, 2, 3))]
    found = [peaks.max_velocity_m_s, peaks.max_acceleration_m_s2, peaks.max_jerk_m_s3]
    # Between samples a polynomial can rise by at most its slope times half a step.
    slopes = [np.abs(c.deriv(n)(u)).max() for n in (1, 2, 3, 4)]
    slack = [slope * duration / 4000 + 1e-9 for slope in slopes]
    low, high = peaks.range_m
    assert low <= signals[0].min() + 1e-9 <= low + slack[0] + 1e-9
    assert high >= signals[0].max() - 1e-9 >= high - slack[0] - 1e-9
    for value, signal, room in zip(found, signals[1:], slack[1:], strict=True):
        assert value >= np.abs(signal).max() * (1 - 1e-12)
        assert value <= np.abs(signal).max() + room


def test_peaks_of_a_cubic_are_its_analytic_extremes():
    # x = s - s^3/3: velocity vanishes at s = 1, where x = 2/3.
    peaks = single(1.5, 0.0, 1.0, 0.0, -1 / 3).peaks()
    assert peaks.range_m == pytest.approx((0.0, 2 / 3), abs=1e-15)
    assert peaks.range_at_s == pytest.approx((0.0, 1.0), abs=1e-12)
    assert peaks.max_velocity_m_s == pytest.approx(1.25, rel=1e-14)
    assert peaks.max_velocity_at_s == pytest.approx(1.5)
    assert peaks.max_acceleration_m_s2 == pytest.approx(3.0, rel=1e-14)
    assert peaks.max_jerk_m_s3 == pytest.approx(2.0, rel=1e-14)


def test_peaks_tell_when_they_occur_in_a_long_table():
    move = point_to_point(0.0, 0.3, 0.5, 4.0, 100.0)
    rests = Trajectory.at_rest(0.0, 1.0).repeat(5000)
    peaks = rests.then(move).peaks()
    alone = move.peaks()
    assert peaks.max_velocity_m_s == alone.max_velocity_m_s
    assert peaks.max_velocity_at_s == pytest.approx(rests.duration_s + alone.max_velocity_at_s)
    assert peaks.range_at_s == (0.0, pytest.approx(rests.duration_s + move.duration_s))


def test_samples_of_a_hermite_table_meet_every_state_that_it_joins():
    t = np.array([0.0, 0.1, 0.35, 0.4])
    x, v, a = np.array([0, 0.1, 0.05, 0.3]), np.array([0, 1, -2, 0.5]), np.array([3.0, 0, -9, 1])
    trajectory = Trajectory(hermite_segments(np.diff(t), x, v, a))
    got = trajectory.sample(t)
    for expected, signal, tolerance in zip((x, v, a), got, (1e-15, 1e-13, 1e-11), strict=True):
        np.testing.assert_allclose(signal, expected, rtol=0, atol=tolerance)
    assert_continuous(trajectory)


def test_sampling_keeps_the_shape_and_holds_the_ends():
    trajectory = single(2.0, 1.0, 0.5)
    x, v, a = trajectory.sample([[-1.0, 0.0], [1.0, 5.0]])
    np.testing.assert_array_equal(x, [[1.0, 1.0], [1.5, 2.0]])
    np.testing.assert_array_equal(v, np.full((2, 2), 0.5))
    np.testing.assert_array_equal(a, np.zeros((2, 2)))
    assert (trajectory.start_m, trajectory.end_m, trajectory.duration_s) == (1.0, 2.0, 2.0)


def test_a_motion_can_be_followed_by_a_rest_and_by_its_way_back():
    forth = point_to_point(0.0, 0.2, 1.0, 10.0, 500.0)
    back = point_to_point(0.2, 0.0, 1.0, 10.0, 500.0)
    both = forth.hold(0.5).then(back).repeat(3)
    assert both.duration_s == pytest.approx(3 * (2 * forth.duration_s + 0.5), rel=1e-12)
    assert both.sample(forth.duration_s + 0.25)[0] == 0.2
    assert_continuous(both)


@pytest.mark.parametrize(
    ("next_motion", "what"),
    [
        (lambda: single(1.0, 0.1), "position steps from 0.2 to 0.1 m"),
        (lambda: single(1.0, 0.2, 0.3), "velocity steps from 0 to 0.3 m/s"),
        (lambda: single(1.0, 0.2, 0.0, 2.5), r"acceleration steps from 0 to 5 m/s\^2"),
    ],
)
def test_no_joint_may_step_in_position_velocity_or_acceleration(next_motion, what):
    rest = Trajectory.at_rest(0.2, 1.5)
    with pytest.raises(UsageError, match=what + " at 1.5 s"):
        rest.then(next_motion())


def test_a_motion_that_ends_moving_cannot_be_held():
    with pytest.raises(UsageError, match="velocity steps"):
        single(1.0, 0.0, 0.5).hold(1.0)


def test_a_table_that_is_no_motion_is_refused():
    for segments in (np.zeros(0, SEGMENT), np.zeros((1, 1), SEGMENT), np.zeros(3)):
        with pytest.raises(UsageError, match="needs a table"):
            Trajectory(segments)
    with pytest.raises(UsageError, match="finite"):
        single(1.0, np.nan)
    with pytest.raises(UsageError, match="negative durations"):
        single(-1.0, 0.0)


def test_a_trajectory_keeps_its_own_table():
    segments = np.zeros(1, SEGMENT)
    trajectory = Trajectory(segments)
    segments["c"][0, 0] = 5.0
    assert trajectory.start_m == 0.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.segments["c"][0, 0] = 1.0
