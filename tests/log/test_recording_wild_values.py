"""A damaged value among thousands is left out and told; what machines do is left in."""

import numpy as np
import pytest
from recorded_rows import write_csv

from motorctl.log import read_recording

N = 3000
TIME = np.arange(N) / 500.0


def moved(kind):
    """Return positions of several kinds of motion."""
    rng = np.random.default_rng(2)
    swing = 0.1 * np.sin(3.0 * TIME)
    triangle = 0.1 * np.abs((TIME % 2.0) - 1.0)
    late = np.where(TIME < 3.0, 1e-3 * TIME, 3e-3 + 0.2 * (TIME - 3.0))
    return {
        "swing": 1e-6 * np.rint(swing / 1e-6),
        "noise": swing + 1e-4 * rng.standard_normal(N),
        "bounces": triangle,
        "one impact": late,
        "knock": np.where(abs(TIME - 3.0) < 0.02, 0.3, swing),
        "jump": np.where(TIME < 0.04, 5.0, swing),
        "coarse": 0.01 * np.rint(swing / 0.01),
        "rest with one count": np.where(np.arange(N) == 700, 1e-6, 0.0),
    }[kind]


def read(tmp_path, position):
    table = {"time_s": TIME, "x.position_m": position, "x.command_v": np.cos(3.0 * TIME)}
    return read_recording(write_csv(tmp_path / "a.csv", table))


KINDS = [
    "swing",
    "noise",
    "bounces",
    "one impact",
    "knock",
    "jump",
    "coarse",
    "rest with one count",
]


@pytest.mark.parametrize("kind", KINDS)
def test_what_machines_do_is_no_damage(tmp_path, kind):
    recording = read(tmp_path, moved(kind))
    assert recording.notes == ()
    assert recording.axes["x"].recorded is None
    np.testing.assert_array_equal(recording.axes["x"].position, moved(kind))


@pytest.mark.parametrize("kind", ["swing", "noise", "bounces", "coarse"])
@pytest.mark.parametrize("rows", [[700], [0], [N - 1], [1], [400, 402, 2000]])
@pytest.mark.parametrize("value", [1e6, 1.0, -3.0])
def test_a_damaged_value_is_told_with_its_row_and_left_out(tmp_path, kind, rows, value):
    position = moved(kind)
    position[rows] = value
    recording = read(tmp_path, position)
    (note,) = recording.notes
    assert "column 'x.position_m' has" in note
    for row in rows:
        assert f"row {row + 1} (line {row + 2}) is {value:g}" in note
    axis = recording.axes["x"]
    np.testing.assert_array_equal(np.flatnonzero(~axis.recorded), rows)
    np.testing.assert_allclose(axis.position, moved(kind), atol=6e-3)


@pytest.mark.parametrize("kind", ["swing", "noise", "bounces", "coarse"])
@pytest.mark.parametrize("value", [-np.pi, 0.7])
def test_what_failed_reads_leave_is_left_out_however_often_and_in_a_row(tmp_path, kind, value):
    rows = np.sort(np.r_[100:2900:120, 221, 1541])
    position = moved(kind)
    position[rows] = value
    recording = read(tmp_path, position)
    assert f"has {len(rows)} damaged values" in recording.notes[0]
    axis = recording.axes["x"]
    np.testing.assert_array_equal(np.flatnonzero(~axis.recorded), rows)


def test_a_damaged_value_beside_failed_reads_is_left_out_too(tmp_path):
    position = moved("noise")
    position[[300, 900, 1500]], position[2000] = -np.pi, 3.5
    axis = read(tmp_path, position).axes["x"]
    np.testing.assert_array_equal(np.flatnonzero(~axis.recorded), [300, 900, 1500, 2000])


@pytest.mark.parametrize(
    "visits", [[100, 101, 102, 103], [100, 101, 102, 900, 901, 902, 2000, 2001]]
)
def test_places_that_an_axis_visits_for_some_rows_are_no_failed_reads(tmp_path, visits):
    position = np.zeros(N)
    position[visits] = 0.5
    position[1500:1540] = 1e-6
    assert read(tmp_path, position).axes["x"].recorded is None


@pytest.mark.parametrize("rows", [[700, 701], [700, 702, 703, 1200]])
def test_two_failed_reads_behind_each_other_are_left_out(tmp_path, rows):
    position = moved("noise")
    position[rows] = -np.pi
    axis = read(tmp_path, position).axes["x"]
    np.testing.assert_array_equal(np.flatnonzero(~axis.recorded), rows)


def test_of_a_described_recording_too(tmp_path):
    position = moved("swing")
    position[700] = 40.0
    write_csv(tmp_path / "a.csv", {"q": position, "u": np.cos(3.0 * TIME)})
    (tmp_path / "a.yaml").write_text(
        "file: a.csv\nsample_rate_hz: 500\naxes:\n  x:\n"
        "    position: {column: q, unit: m}\n    command: {column: u, unit: V}\n"
    )
    recording = read_recording(tmp_path / "a.yaml")
    assert "row 701 (line 702) is 40, with -0.0" in recording.notes[0]
    np.testing.assert_allclose(recording.axes["x"].position, moved("swing"), atol=1e-4)
