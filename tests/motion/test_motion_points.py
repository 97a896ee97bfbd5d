"""Promises of motion through recorded points."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motion_bounds import assert_at_rest_at_both_ends, assert_continuous

from motorctl.errors import ConfigError
from motorctl.motion import MOST_SEGMENTS, Points, load_program_file, point_to_point


def write(path, columns):
    names = list(columns)
    lines = [",".join(names)]
    lines += [
        ",".join(f"{value!r}" for value in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def sampled_move(rows=400, end=0.3):
    move = point_to_point(0.0, end, 0.5, 4.0, 100.0)
    t = np.linspace(0, move.duration_s, rows)
    return t.tolist(), move.sample(t)[0].tolist(), move


def points(file, axes=("x",), **keys):
    return Points(name="recorded", axes=axes, file=file, **keys)


def problems_of(call):
    with pytest.raises(ConfigError) as told:
        call()
    return told.value.problems


def test_the_curve_passes_through_every_point_and_follows_the_motion_between(tmp_path):
    t, x, move = sampled_move()
    trajectory = points(write(tmp_path / "p.csv", {"time_s": t, "x_m": x})).trajectories()["x"]
    np.testing.assert_allclose(trajectory.sample(t)[0], x, atol=1e-14)
    between = np.linspace(0, move.duration_s, 5000)
    assert np.abs(trajectory.sample(between)[0] - move.sample(between)[0]).max() < 1e-7
    assert trajectory.peaks().max_jerk_m_s3 < 2 * 100.0
    assert_continuous(trajectory)
    assert_at_rest_at_both_ends(trajectory)


@given(st.lists(st.tuples(st.floats(1e-3, 1), st.floats(-1, 1)), min_size=2, max_size=40))
@example([(0.5, 0.0), (0.125, 0.0), *[(1.0, 0.0)] * 2, *[(2**-9, float(k == 1)) for k in range(3)]])
@settings(max_examples=60)
def test_any_points_between_two_dwells_give_a_continuous_motion(tmp_path_factory, steps):
    gaps, inner = zip(*steps, strict=True)
    x = [inner[0], inner[0], *inner, inner[-1], inner[-1]]
    t = np.cumsum([0.0, 0.1, *gaps, 0.1, 0.1]).tolist()
    path = tmp_path_factory.mktemp("points") / "p.csv"
    trajectory = points(write(path, {"time_s": t, "x_m": x})).trajectories()["x"]
    # A time is known to its last digit, in which a curve at 1000 m/s moves by a picometre.
    by_rounding = 4.0 * np.spacing(t[-1]) * trajectory.peaks().max_velocity_m_s
    np.testing.assert_allclose(trajectory.sample(t)[0], x, atol=1e-12 + by_rounding)
    assert_continuous(trajectory, v=1e-8, a=1e-6)
    assert np.isfinite(trajectory.peaks().max_jerk_m_s3)


def test_two_points_are_joined_by_one_quintic_from_rest_to_rest(tmp_path):
    file = write(tmp_path / "p.csv", {"time_s": [5.0, 7.0], "x_m": [0.1, 0.3]})
    trajectory = points(file).trajectories()["x"]
    # Rest to rest in T: velocity peaks at 15/8 d/T.
    assert trajectory.peaks().max_velocity_m_s == pytest.approx(15 / 8 * 0.2 / 2)
    assert trajectory.duration_s == 2.0


def test_several_axes_come_from_one_file_beside_columns_of_no_concern(tmp_path):
    t, x, _ = sampled_move()
    y = [0.5 - value for value in x]
    file = write(tmp_path / "p.csv", {"y_m": y, "note": x, "time_s": t, "x_m": x})
    program = points(file, axes=("x", "y"))
    trajectories = program.trajectories()
    assert trajectories["x"].end_m == pytest.approx(0.3, abs=1e-15)
    assert trajectories["y"].end_m == pytest.approx(0.2, abs=1e-15)
    assert trajectories["x"].duration_s == trajectories["y"].duration_s
    assert (program.period_s, program.cycles) == (None, 1)


def test_points_that_move_at_an_end_are_refused_with_line_and_speed(tmp_path):
    t = np.linspace(0, 1, 101)
    sine = (0.1 * np.sin(2 * np.pi * t)).tolist()
    file = write(tmp_path / "p.csv", {"time_s": t.tolist(), "x_m": sine})
    first, last = problems_of(lambda: points(file))
    assert str(first).startswith(f"{file}:2: x_m: starts at 0.62")
    assert str(last).startswith(f"{file}:102: x_m: ends at 0.62")
    assert "ease_s" in first.message


def test_ease_leads_in_from_rest_and_out_to_rest_without_changing_the_points(tmp_path):
    t = np.linspace(0, 1, 201)
    sine = 0.1 * np.sin(2 * np.pi * t)
    file = write(tmp_path / "p.csv", {"time_s": t.tolist(), "x_m": sine.tolist()})
    trajectory = points(file, ease_s=0.25).trajectories()["x"]
    assert trajectory.duration_s == pytest.approx(1.5)
    np.testing.assert_allclose(trajectory.sample(0.25 + t)[0], sine, atol=1e-13)
    # From rest to 0.628 m/s at an even acceleration would need half of that times the time.
    assert trajectory.start_m == pytest.approx(-0.2 * np.pi * 0.25 / 2, rel=1e-4)
    assert trajectory.peaks().max_velocity_m_s == pytest.approx(0.2 * np.pi, rel=1e-4)
    assert_continuous(trajectory)
    assert_at_rest_at_both_ends(trajectory)


def test_ease_needs_enough_points_to_know_the_motion_at_the_ends(tmp_path):
    file = write(tmp_path / "p.csv", {"time_s": [0.0, 1.0], "x_m": [0.0, 1.0]})
    (problem,) = problems_of(lambda: points(file, ease_s=0.1))
    assert problem.message == "ease_s needs at least 6 rows of points, there are 2"


def test_points_that_end_where_they_start_can_be_repeated(tmp_path):
    t, x, _ = sampled_move()
    there_and_back = {
        "time_s": [*t, *(t[-1] + 0.1 + np.array(t)).tolist()],
        "x_m": x + x[::-1],
    }
    program = points(write(tmp_path / "p.csv", there_and_back), cycles=4)
    trajectory = program.trajectories()["x"]
    assert program.period_s == pytest.approx(2 * t[-1] + 0.1)
    assert trajectory.duration_s == pytest.approx(4 * program.period_s)
    assert_continuous(trajectory)


def test_points_that_end_elsewhere_cannot_be_repeated(tmp_path):
    t, x, _ = sampled_move()
    file = write(tmp_path / "p.csv", {"time_s": t, "x_m": x})
    (problem,) = problems_of(lambda: points(file, cycles=2))
    assert "ends at 0.3 m but starts at 0 m" in problem.message


def test_more_points_than_a_program_may_have_are_refused(tmp_path):
    rows = MOST_SEGMENTS + 2
    t, x = np.arange(rows) * 1e-3, np.zeros(rows)
    file = write(tmp_path / "p.csv", {"time_s": t.tolist(), "x_m": x.tolist()})
    (problem,) = problems_of(lambda: points(file))
    assert str(MOST_SEGMENTS) in problem.message


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        ("", None, "", "is empty"),
        ("x_m\n0\n", 1, "time_s", "column is missing; there are: x_m"),
        ("time_s,y_m\n0,0\n1,1\n", 1, "x_m", "column is missing"),
        ("time_s,x_m,x_m\n0,0,0\n1,1,1\n", 1, "x_m", "more than once"),
        ("time_s,x_m\n0,0\n1,abc\n2,0\n", 3, "x_m", "'abc' is no number"),
        ("time_s,x_m\n0,0\n1,\n2,0\n", 3, "x_m", "'' is no number"),
        ("time_s,x_m\n0,0\nnan,0\n", 3, "time_s", "'nan' does not lie within 1e+06"),
        ("time_s,x_m\n0,0\n1,inf\n", 3, "x_m", "'inf' does not lie within 1e+06"),
        ("time_s,x_m\n0,0\n1\n2,0\n", 3, "", "1 cells where the header has 2"),
        (
            "time_s,x_m\n0,0\n1,0\n\n1,0\n",
            5,
            "time_s",
            "1 must exceed 1 of the row before by 1e-06",
        ),
        ("time_s,x_m\n0,0\n2,0\n1,0\n", 4, "time_s", "1 must exceed 2 of the row before"),
        ("time_s,x_m\n", None, "", "at least 2 rows of points, has 0"),
        ("time_s,x_m\n0,0\n", None, "", "at least 2 rows of points, has 1"),
    ],
)
def test_bad_points_are_told_with_file_line_and_column(tmp_path, text, line, column, message):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    problem = problems_of(lambda: points(file))[0]
    assert (problem.file, problem.line, problem.key) == (str(file), line, column)
    assert message in problem.message


def test_all_bad_cells_are_told_at_once_but_not_thousands(tmp_path):
    file = tmp_path / "bad.csv"
    file.write_text("time_s,x_m\n" + "".join(f"{k},?\n" for k in range(1000)))
    problems = problems_of(lambda: points(file))
    assert len(problems) == 21
    assert problems[0].line == 2
    assert problems[-1].message == "and 980 more problems"


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"\xff\xfe\x00", "is not CSV text"), (None, "No such file or directory")],
)
def test_a_file_that_cannot_be_read_is_told(tmp_path, content, message):
    file = tmp_path / "p.csv"
    if content is not None:
        file.write_bytes(content)
    (problem,) = problems_of(lambda: points(file))
    assert (problem.file, problem.line) == (str(file), None)
    assert message in problem.message


def test_a_csv_file_is_a_program_of_the_axes_in_its_header(tmp_path):
    t, x, _ = sampled_move()
    write(tmp_path / "tune.csv", {"time_s": t, "y_m": x})
    program = load_program_file(tmp_path / "tune.csv", ["x", "y"])
    assert (program.name, program.axes) == ("tune", ("y",))


@pytest.mark.parametrize(
    ("header", "column", "message"),
    [
        ("time_s,z_m", "z_m", "unknown column; known: time_s, x_m, y_m"),
        ("time_s,x", "x", "unknown column"),
        ("time_s", "", "no column of an axis; known: x_m, y_m"),
    ],
)
def test_a_csv_file_with_other_columns_is_no_program(tmp_path, header, column, message):
    file = tmp_path / "p.csv"
    file.write_text(f"{header}\n0,0\n")
    (problem,) = problems_of(lambda: load_program_file(file, ["x", "y"]))
    assert (problem.line, problem.key) == (1, column)
    assert message in problem.message
