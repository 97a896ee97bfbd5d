"""Promises of the program that lists its moves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_bounds import assert_at_rest_at_both_ends, assert_continuous, assert_within

from motorctl.errors import ConfigError
from motorctl.motion import (
    MOST_SEGMENTS,
    AxisLimits,
    Move,
    Moves,
    check_program,
    load_program_file,
    point_to_point,
)

TEXT = """\
kind: moves
axis: x
start_m: 0
moves:
  - {target_m: 0.3, max_velocity_m_s: 1, max_acceleration_m_s2: 9, max_jerk_m_s3: 500, dwell_s: 0.2}
  - {target_m: 0.29, max_velocity_m_s: 0.01, max_acceleration_m_s2: 1, max_jerk_m_s3: 50}
  - {target_m: 0, max_velocity_m_s: 0.5, max_acceleration_m_s2: 5, max_jerk_m_s3: 300}
cycles: 2
"""


def load(folder, text):
    (folder / "show.yaml").write_text(text)
    return load_program_file(folder / "show.yaml", ("x", "y"))


def move(target, velocity=1.0, acceleration=10.0, jerk=500.0, dwell=0.0):
    return Move(
        target_m=target,
        max_velocity_m_s=velocity,
        max_acceleration_m_s2=acceleration,
        max_jerk_m_s3=jerk,
        dwell_s=dwell,
    )


def listed(*moves, start=0.0, cycles=1):
    return Moves(name="list", axis="x", start_m=start, moves=moves, cycles=cycles)


def test_every_move_is_the_point_to_point_move_of_its_own_limits(tmp_path):
    trajectory = load(tmp_path, TEXT).trajectories()["x"]
    plans = (
        (point_to_point(0.0, 0.3, 1.0, 9.0, 500.0), 0.2),
        (point_to_point(0.3, 0.29, 0.01, 1.0, 50.0), 0.0),
        (point_to_point(0.29, 0.0, 0.5, 5.0, 300.0), 0.0),
    )
    at = 0.0
    for plan, dwell_s in plans * 2:
        t = np.linspace(0.0, plan.duration_s, 50)
        np.testing.assert_allclose(trajectory.sample(at + t)[0], plan.sample(t)[0], atol=1e-12)
        at += plan.duration_s + dwell_s
    assert trajectory.duration_s == pytest.approx(at, rel=1e-12)


def test_it_stands_still_while_it_dwells():
    first = point_to_point(0.0, 0.3, 1.0, 10.0, 500.0)
    trajectory = listed(move(0.3, dwell=0.7), move(0.1)).trajectories()["x"]
    x, v, a = trajectory.sample(first.duration_s + np.linspace(0.0, 0.7, 20))
    np.testing.assert_allclose(x, 0.3, atol=1e-12)
    np.testing.assert_allclose(np.concatenate([v, a]), 0.0, atol=1e-9)


targets = st.floats(-1, 1)
limits = st.tuples(st.floats(1e-3, 2), st.floats(0.05, 40), st.floats(1, 5000))


@given(targets, st.lists(st.tuples(targets, limits, st.floats(0, 1)), min_size=1, max_size=8))
@settings(max_examples=50)
def test_any_list_is_continuous_keeps_its_limits_and_ends_at_the_last_target(start, wishes):
    program = listed(*(move(x, *bounds, dwell) for x, bounds, dwell in wishes), start=start)
    trajectory = program.trajectories()["x"]
    assert trajectory.start_m == pytest.approx(start, abs=1e-12)
    assert trajectory.end_m == pytest.approx(wishes[-1][0], abs=1e-12)
    assert_continuous(trajectory)
    assert_at_rest_at_both_ends(trajectory)
    assert_within(trajectory, *(max(bounds[k] for _, bounds, _ in wishes) for k in range(3)))


def test_a_list_that_returns_can_be_repeated():
    program = listed(move(0.2, dwell=0.1), move(0.0), cycles=5)
    trajectory = program.trajectories()["x"]
    assert trajectory.duration_s == pytest.approx(5 * program.period_s, rel=1e-12)
    np.testing.assert_allclose(trajectory.sample(np.arange(6) * program.period_s)[0], 0, atol=1e-9)
    assert listed(move(0.2), move(0.0)).period_s is None


def test_moves_to_where_the_axis_stands_take_no_time():
    trajectory = listed(move(0.3), move(0.3), start=0.3).trajectories()["x"]
    assert (trajectory.duration_s, trajectory.start_m, trajectory.end_m) == (0.0, 0.3, 0.3)


def test_the_worst_of_all_moves_is_held_against_the_limits():
    program = listed(move(0.1), move(0.6, velocity=1.2), move(0.2))
    allowed = AxisLimits((-0.1, 0.5), 1.1, 20.0, 1000.0, 10.0)
    found = {v.quantity: v.value for v in check_program(program, {"x": allowed})}
    assert found == {
        "position": pytest.approx(0.6),
        "velocity": pytest.approx(1.2),
    }


@pytest.mark.parametrize(
    ("change", "line", "key", "message"),
    [
        (("target_m: 0.29", "target_m: near"), 6, "moves.1.target_m", "valid number"),
        (("target_m: 0.29", "target_m: '0.29'"), 6, "moves.1.target_m", "valid number"),
        (("target_m: 0.29", "target_m: .inf"), 6, "moves.1.target_m", "finite number"),
        (("target_m: 0.29, ", ""), 6, "moves.1.target_m", "this key is missing"),
        (("dwell_s: 0.2", "dwell_s: -1"), 5, "moves.0.dwell_s", "greater than or equal to 0"),
        (("dwell_s: 0.2", "pause_s: 1"), 5, "moves.0.pause_s", "unknown key"),
        (
            ("max_velocity_m_s: 0.5", "max_velocity_m_s: 0"),
            7,
            "moves.2.max_velocity_m_s",
            "greater",
        ),
        (("target_m: 0,", "target_m: 0.1,"), 8, "cycles", "end at 0.1 m but start at 0 m"),
        (("cycles: 2", "cycles: 4000"), 8, "cycles", f"more than the {MOST_SEGMENTS} segments"),
    ],
)
def test_a_problem_in_a_list_is_told_once_with_its_line_and_key(
    tmp_path, change, line, key, message
):
    assert change[0] in TEXT
    with pytest.raises(ConfigError) as told:
        load(tmp_path, TEXT.replace(*change))
    (problem,) = told.value.problems
    assert (problem.line, problem.key) == (line, key)
    assert message in problem.message


def test_a_list_needs_a_move(tmp_path):
    with pytest.raises(ConfigError, match="at least one move"):
        load(tmp_path, "{kind: moves, axis: x, start_m: 0, moves: []}")
