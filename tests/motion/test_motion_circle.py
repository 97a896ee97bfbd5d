"""Promises of circles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_bounds import assert_at_rest_at_both_ends, assert_continuous
from pydantic import ValidationError

from motorctl.errors import UsageError
from motorctl.motion import Circle

KEYS = {
    "name": "ring",
    "axes": ("x", "y"),
    "center_m": (0.2, 0.1),
    "radius_m": 0.05,
    "speed_m_s": 0.3,
    "max_acceleration_m_s2": 5.0,
    "max_jerk_m_s3": 500.0,
    "turns": 3.0,
}


def ring(**keys):
    return Circle(**{**KEYS, **keys})


def vectors(circle, points=20001):
    """Sample time, x, v, a and (by differences within segments) nothing else, all (2, N)."""
    first, second = (circle.trajectories()[axis] for axis in circle.axes)
    assert first.duration_s == second.duration_s
    t = np.linspace(0, first.duration_s, points)
    return t, *(np.stack(pair) for pair in zip(first.sample(t), second.sample(t), strict=True))


def jerk_vectors(circle):
    """Jerk at the start of every segment, (2, N)."""
    tables = (circle.trajectories()[axis].segments for axis in circle.axes)
    return np.stack([6 * table["c"][:, 3] for table in tables])


@given(
    radius=st.floats(0.001, 1.0),
    speed=st.floats(0.01, 2.0),
    acceleration_room=st.floats(1.01, 20),
    jerk_room=st.floats(1.01, 20),
    turns=st.floats(0.01, 3) | st.floats(-3, -0.01),
    start=st.floats(-7, 7),
)
@settings(max_examples=60)
def test_a_circle_stays_round_and_keeps_its_limits_on_the_path(
    radius, speed, acceleration_room, jerk_room, turns, start
):
    acceleration = acceleration_room * speed**2 / radius
    jerk = jerk_room * speed**3 / radius**2
    circle = ring(
        radius_m=radius,
        speed_m_s=speed,
        max_acceleration_m_s2=acceleration,
        max_jerk_m_s3=jerk,
        turns=turns,
        start_angle_rad=start,
    )
    _, x, v, a = vectors(circle, 5001)
    offsets = x - np.array([[0.2], [0.1]])
    assert np.abs(np.hypot(*offsets) - radius).max() < 1e-9
    assert np.hypot(*v).max() <= speed * (1 + 1e-6)
    assert np.hypot(*a).max() <= acceleration * (1 + 1e-6)
    assert np.hypot(*jerk_vectors(circle)).max() <= jerk * 1.01
    for trajectory in circle.trajectories().values():
        assert_continuous(trajectory)
        assert_at_rest_at_both_ends(trajectory)


def test_the_point_on_the_circle_is_where_the_path_says():
    circle = ring(turns=2.0, start_angle_rad=0.4)
    t, x, v, _ = vectors(circle)
    angle = np.unwrap(np.arctan2(x[1] - 0.1, x[0] - 0.2))
    assert angle[0] == pytest.approx(0.4, abs=1e-12)
    assert angle[-1] - angle[0] == pytest.approx(4 * math.pi, abs=1e-10)
    assert (np.diff(angle) > -1e-12).all()
    # Position is within a nanometre of the circle at the angle that speed integrates to.
    way = np.concatenate([[0], np.cumsum(np.hypot(*v)[1:] + np.hypot(*v)[:-1]) / 2 * np.diff(t)])
    np.testing.assert_allclose(0.05 * (angle - 0.4), way, atol=1e-7)


def test_a_circle_of_more_segments_than_a_program_may_have_is_refused():
    with pytest.raises(UsageError, match="'ring': 1000 turns on a radius of 8 m need more than"):
        ring(turns=1000.0, radius_m=8.0).trajectories()


def test_negative_turns_run_clockwise():
    _, x, _, _ = vectors(ring(turns=-1.0))
    angle = np.unwrap(np.arctan2(x[1] - 0.1, x[0] - 0.2))
    assert angle[-1] == pytest.approx(-2 * math.pi, abs=1e-10)


def test_a_full_turn_ends_where_it_starts():
    _, x, _, _ = vectors(ring(turns=3.0))
    np.testing.assert_allclose(x[:, -1], x[:, 0], atol=1e-12)
    np.testing.assert_allclose(x[:, 0], [0.25, 0.1], atol=1e-15)


def test_in_the_steady_part_speed_and_centripetal_acceleration_are_as_asked():
    _, _, v, a = vectors(ring())
    middle = v.shape[1] // 2
    assert np.hypot(*v[:, middle]) == pytest.approx(0.3, rel=1e-8)
    assert np.hypot(*a[:, middle]) == pytest.approx(0.3**2 / 0.05, rel=1e-5)


@pytest.mark.parametrize(
    ("keys", "key", "message"),
    [
        (
            {"speed_m_s": 0.6},
            "max_acceleration_m_s2",
            r"alone needs 7.2 m/s\^2; use more, or a speed_m_s below 0.5",
        ),
        (
            {"max_jerk_m_s3": 10.0},
            "max_jerk_m_s3",
            r"alone needs 10.8 m/s\^3; use more, or a speed_m_s below 0.2924",
        ),
        ({"axes": ("x", "x")}, "axes", "two different axes"),
        ({"turns": 0.0}, "turns", "must not be 0"),
    ],
)
def test_an_impossible_circle_is_refused_with_the_key_and_what_would_do(keys, key, message):
    with pytest.raises(ValidationError, match=message) as told:
        ring(**keys)
    assert told.value.errors()[0]["loc"] == (key,)
