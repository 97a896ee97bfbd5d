"""Promises of programs in YAML, and of the check before anything moves."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from motorctl.errors import ConfigError, UsageError
from motorctl.motion import (
    AxisLimits,
    BackAndForth,
    Circle,
    PointToPoint,
    Program,
    check_program,
    load_program_file,
    parse_program,
)

AXES = ("x", "y")
BACK_AND_FORTH = """\
kind: back_and_forth
axis: x
start_m: 0
distance_m: 0.4
max_velocity_m_s: 1.05
max_acceleration_m_s2: 35.6
jerk_time_s: 8.6e-3
period_s: 3.5
cycles: 12
"""
RING = """\
kind: circle
axes: [x, y]
center_m: [0.2, 0.2]
radius_m: 0.05
speed_m_s: 0.3
max_acceleration_m_s2: 5
max_jerk_m_s3: 500
turns: 3
"""
MOVE = """\
kind: point_to_point
axis: y
start_m: 0
target_m: 0.3
max_velocity_m_s: 1
max_acceleration_m_s2: 10
max_jerk_m_s3: 500
"""


def load(folder, text, name="motion.yaml"):
    (folder / name).write_text(text)
    return load_program_file(folder / name, AXES)


def problems_of(folder, text):
    with pytest.raises(ConfigError) as told:
        load(folder, text)
    assert all(p.file == str(folder / "motion.yaml") for p in told.value.problems)
    return [(p.line, p.key, p.message) for p in told.value.problems]


@pytest.mark.parametrize(
    ("text", "kind", "axes"),
    [
        (BACK_AND_FORTH, BackAndForth, ("x",)),
        (RING, Circle, ("x", "y")),
        (MOVE, PointToPoint, ("y",)),
    ],
)
def test_each_kind_loads_from_a_file_and_is_named_after_it(tmp_path, text, kind, axes):
    program = load(tmp_path, text)
    assert isinstance(program, kind)
    assert isinstance(program, Program)
    assert (program.name, program.axes) == ("motion", axes)
    assert set(program.trajectories()) == set(axes)


def test_points_are_looked_for_beside_the_file_that_names_them(tmp_path):
    (tmp_path / "p.csv").write_text("time_s,x_m\n0,0\n1,0.1\n")
    program = load(tmp_path, "{kind: points, axes: [x], file: p.csv}")
    assert program.trajectories()["x"].end_m == pytest.approx(0.1, abs=1e-15)


def test_problems_of_points_name_the_csv_file(tmp_path):
    (tmp_path / "p.csv").write_text("time_s,x_m\n0,0\n1,?\n")
    with pytest.raises(ConfigError) as told:
        load(tmp_path, "{kind: points, axes: [x], file: p.csv}")
    assert str(told.value) == f"{tmp_path / 'p.csv'}:3: x_m: '?' is no number"


@pytest.mark.parametrize(
    ("change", "line", "key", "message"),
    [
        (("distance_m: 0.4", "distance_m: far"), 4, "distance_m", "(given: 'far')"),
        (("distance_m: 0.4", "distance_m: 0"), 4, "distance_m", "must not be 0 (given: 0)"),
        (("distance_m: 0.4", "distance_m: .inf"), 4, "distance_m", "finite"),
        (("distance_m: 0.4", "distance_m: .nan"), 4, "distance_m", "(given: '.nan')"),
        (
            ("jerk_time_s: 8.6e-3", "jerk_time_s: -1"),
            7,
            "jerk_time_s",
            "greater than 0.000000001 (given: -1",
        ),
        (("period_s: 3.5", "period_s: 0.5"), 8, "period_s", "at least 0.838094 s"),
        (("cycles: 12", "cycles: 0"), 9, "cycles", "greater than or equal to 1"),
        (("cycles: 12", "cycles: 5000"), 9, "cycles", "more than the 65000 segments"),
        (("cycles: 12", "cycle: 12"), 9, "cycle", "unknown key; known: axis, kind, start_m"),
        (("period_s: 3.5\n", ""), 1, "period_s", "this key is missing"),
        (
            ("kind: back_and_forth", "kind: wobble"),
            1,
            "kind",
            "unknown kind 'wobble'; known: point",
        ),
        (("kind: back_and_forth\n", ""), 1, "kind", "this key is missing; it is one of: point"),
        (("axis: x", "axis: z"), 2, "axis", "unknown axis 'z'; known: x, y"),
        (("cycles: 12", "name: me"), 9, "name", "unknown key: the name of a program"),
        (("cycles: 12", "axis: y"), 9, "axis", "stands twice, first on line 2"),
        (("cycles: 12", "- 12"), 9, "", "not valid YAML"),
    ],
)
def test_a_wrong_program_is_told_with_line_and_key(tmp_path, change, line, key, message):
    ((told_line, told_key, told_message),) = problems_of(tmp_path, BACK_AND_FORTH.replace(*change))
    assert (told_line, told_key) == (line, key)
    assert message in told_message


def test_an_entry_of_a_list_is_told_with_its_own_line(tmp_path):
    text = RING.replace("[0.2, 0.2]", "\n- 0.2\n- wide")
    assert problems_of(tmp_path, text)[0][:2] == (5, "center_m.1")


def test_all_problems_are_told_at_once(tmp_path):
    text = RING.replace("0.05", "-1").replace("turns: 3", "turns: many")
    assert [p[:2] for p in problems_of(tmp_path, text)] == [(4, "radius_m"), (8, "turns")]


@pytest.mark.parametrize(
    ("moves", "told", "more"),
    [
        ([{}] * 20_000, ["moves.0.target_m", "moves.19.max_jerk_m_s3"], 79_920),
        ([{f"k{i}": 1 for i in range(100_000)}], ["moves.0.target_m", "moves.0.k31"], 99_968),
        ([1] * 100_000, ["moves.0", "moves.19"], 99_980),
    ],
    ids=["moves", "keys", "numbers"],
)
def test_of_more_problems_than_anybody_reads_the_first_are_told_and_soon(moves, told, more):
    keys = {"kind": "moves", "axis": "x", "start_m": 0.1, "moves": moves}
    with pytest.raises(ConfigError) as caught:
        parse_program("p", keys, directory=Path(), axis_names=["x"], file="p")
    problems = caught.value.problems
    assert set(told) <= {problem.key for problem in problems}
    assert len(problems) < 100
    assert problems[-1].message == f"{more} more problems are not told one by one"


@pytest.mark.parametrize("text", ["", "- 1\n", "fast\n"])
def test_a_file_that_is_no_mapping_is_told(tmp_path, text):
    ((_, _, message),) = problems_of(tmp_path, text)
    assert "such as kind: point_to_point, back_and_forth" in message


def test_a_missing_or_binary_file_is_told(tmp_path):
    with pytest.raises(ConfigError, match="no such file"):
        load_program_file(tmp_path / "motion.yaml", AXES)
    (tmp_path / "motion.yaml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="is not UTF-8 text"):
        load_program_file(tmp_path / "motion.yaml", AXES)


def test_a_configuration_gives_its_own_lines_and_prefix():
    with pytest.raises(ConfigError) as told:
        parse_program(
            "ring",
            {**yaml.safe_load(RING), "radius_m": "wide"},
            directory=Path(),
            axis_names=AXES,
            file="machine.yaml",
            line_of={("radius_m",): 40}.get,
            prefix="programs.ring.",
        )
    assert str(told.value).startswith("machine.yaml:40: programs.ring.radius_m: ")


LIMITS = AxisLimits(
    travel_m=(-0.05, 0.45),
    max_velocity_m_s=1.5,
    max_acceleration_m_s2=45,
    max_jerk_m_s3=8000,
    max_voltage_v=10,
)


def limited(**changes):
    return {"x": AxisLimits(**{**LIMITS.__dict__, **changes}), "y": LIMITS}


def test_a_program_within_every_limit_passes(tmp_path):
    program = load(tmp_path, BACK_AND_FORTH)
    voltage = {"x": lambda x, v, a: 0.2 * a + 0.2 * v}
    assert check_program(program, limited(), voltage) == []


def test_a_program_right_at_its_limits_passes(tmp_path):
    program = load(tmp_path, BACK_AND_FORTH)
    exact = limited(
        travel_m=(0.0, 0.4),
        max_velocity_m_s=1.05,
        max_acceleration_m_s2=35.6,
        max_jerk_m_s3=35.6 / 8.6e-3,
    )
    assert check_program(program, exact) == []


@pytest.mark.parametrize(
    ("changes", "quantity", "value", "limit", "time_s"),
    [
        ({"travel_m": (0.01, 0.45)}, "position", 0.0, 0.01, 0.0),
        ({"travel_m": (0.0, 0.3)}, "position", 0.4, 0.3, 0.419046),
        ({"max_velocity_m_s": 1.0}, "velocity", 1.05, 1.0, None),
        ({"max_acceleration_m_s2": 30.0}, "acceleration", 35.6, 30.0, None),
        ({"max_jerk_m_s3": 4000.0}, "jerk", 35.6 / 8.6e-3, 4000.0, None),
    ],
)
def test_each_exceeded_limit_is_listed_with_value_and_time(
    tmp_path, changes, quantity, value, limit, time_s
):
    program = load(tmp_path, BACK_AND_FORTH)
    (violation,) = check_program(program, limited(**changes))
    assert (violation.axis, violation.quantity, violation.limit) == ("x", quantity, limit)
    assert violation.value == pytest.approx(value, abs=1e-12)
    if time_s is not None:
        assert violation.time_s % 3.5 == pytest.approx(time_s, abs=1e-5)
    # The motion is there what the violation says.
    x, v, a = program.trajectories()["x"].sample(violation.time_s)
    if quantity != "jerk":
        at_that_time = {"position": x, "velocity": abs(v), "acceleration": abs(a)}[quantity]
        assert at_that_time == pytest.approx(violation.value, abs=1e-6)


def test_all_exceeded_limits_are_listed(tmp_path):
    tight = limited(
        travel_m=(0.1, 0.3), max_velocity_m_s=0.1, max_acceleration_m_s2=1, max_jerk_m_s3=10
    )
    found = check_program(load(tmp_path, BACK_AND_FORTH), tight)
    assert [v.quantity for v in found] == [
        "position",
        "position",
        "velocity",
        "acceleration",
        "jerk",
    ]
    assert str(found[2]).startswith("axis x: velocity 1.05 m/s at ")
    assert str(found[2]).endswith(" s exceeds the limit 0.1 m/s")


def test_the_voltage_that_a_motion_needs_is_checked(tmp_path):
    program = load(tmp_path, BACK_AND_FORTH)
    needs = {"x": lambda x, v, a: 0.3 * a + 0.2 * v}
    (violation,) = check_program(program, limited(), needs)
    assert (violation.quantity, violation.unit, violation.limit) == ("voltage", "V", 10)
    # The worst is where the acceleration's plateau ends: u = theta1 a + theta2 v there.
    plateau_end = 1.05 / 35.6
    _, v, _ = program.trajectories()["x"].sample(plateau_end)
    assert violation.value == pytest.approx(0.3 * 35.6 + 0.2 * v, rel=1e-9)


def test_a_short_peak_of_voltage_between_rests_is_found(tmp_path):
    program = load(tmp_path, MOVE)
    spot = 0.123
    needs = {"y": lambda x, v, a: 20 * np.exp(-(((x - spot) / 0.001) ** 2))}
    (violation,) = check_program(program, limited(), needs)
    assert violation.value == pytest.approx(20, rel=0.3)
    assert program.trajectories()["y"].sample(violation.time_s)[0] == pytest.approx(spot, abs=1e-3)


def test_a_voltage_that_cannot_be_computed_is_a_violation(tmp_path):
    needs = {"y": lambda x, v, a: np.where(x > 0.2, np.nan, 0.0)}
    (violation,) = check_program(load(tmp_path, MOVE), limited(), needs)
    assert violation.value == np.inf


def test_every_axis_of_a_program_is_checked(tmp_path):
    limits = {"x": LIMITS, "y": AxisLimits((0.0, 0.24), 1.5, 45, 8000, 10)}
    (violation,) = check_program(load(tmp_path, RING), limits)
    assert (violation.axis, violation.quantity) == ("y", "position")
    assert violation.value == pytest.approx(0.25, abs=1e-9)


def test_a_program_of_an_axis_without_limits_is_refused(tmp_path):
    with pytest.raises(UsageError, match="moves unknown axes: y; known: x"):
        check_program(load(tmp_path, RING), {"x": LIMITS})


def test_a_program_cannot_be_changed(tmp_path):
    with pytest.raises(ValueError, match="frozen"):
        load(tmp_path, MOVE).target_m = 1.0
