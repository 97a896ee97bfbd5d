"""Signals that stand in files of their own are read beside each other, row by row."""

import numpy as np
import pytest
import scipy.io

from motorctl.errors import DataError
from motorctl.log import read_recording

N = 100
TIME_S = np.arange(N) / 200.0
SPEED = np.sin(TIME_S * 20.0)
TORQUE = np.cos(TIME_S * 20.0)
AXIS = """time: {column: t}
axes:
  b:
    velocity: {column: w, unit: rad/s}
    command: {file: torque.csv, column: u, unit: N m}
"""


def write(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")


def described(folder, text=AXIS, first="speed.csv"):
    (folder / "d.yaml").write_text(f"file: {first}\n{text}")
    return read_recording(folder / "d.yaml")


@pytest.fixture
def folder(tmp_path):
    write(tmp_path / "speed.csv", "t,w", TIME_S, SPEED)
    write(tmp_path / "torque.csv", "t,u", TIME_S, TORQUE)
    return tmp_path


def test_speed_and_torque_of_two_text_files_stand_beside_each_other(folder):
    axis = described(folder).axes["b"]
    np.testing.assert_allclose(axis.command, TORQUE, atol=1e-12)
    np.testing.assert_allclose(np.diff(axis.position) * 200.0, SPEED[1:], atol=0.06)


def test_a_scope_in_a_mat_file_stands_beside_another_with_the_same_names(tmp_path):
    for name, values in (("speed", SPEED), ("torque", TORQUE)):
        scope = {"time": TIME_S, "signals": {"values": values}}
        scipy.io.savemat(tmp_path / f"{name}.mat", {"scope": scope})
    text = AXIS.replace("column: t", "column: scope.time").replace("torque.csv", "torque.mat")
    text = text.replace("column: w", "column: scope.signals.values")
    text = text.replace("column: u", "column: scope.signals.values")
    axis = described(tmp_path, text, "speed.mat").axes["b"]
    np.testing.assert_allclose(axis.command, TORQUE)


def test_one_row_more_at_the_end_of_one_file_is_left_out_and_told(folder):
    more = np.arange(N + 1) / 200.0
    write(folder / "torque.csv", "t,u", more, np.cos(more * 20.0))
    recording = described(folder)
    assert len(recording.time_s) == N
    assert "column 't' has 100 rows, and 'torque.csv: u' 101: the last row" in recording.notes[0]


@pytest.mark.parametrize(
    ("time_s", "message"),
    [
        (TIME_S + 0.1, r"torque\.csv: row 1 .*'t' is 0\.1, and 0 in the first file"),
        (TIME_S * 1.1, r"torque\.csv: row \d+ .*; rows that stand beside each other must be of"),
        (TIME_S[:60], r"column 'torque\.csv: u' has 60 rows, but 't' has 100"),
    ],
)
def test_rows_of_another_time_are_refused(folder, time_s, message):
    write(folder / "torque.csv", "t,u", time_s, TORQUE[: len(time_s)])
    with pytest.raises(DataError, match=message):
        described(folder)


def test_a_missing_column_or_file_is_told_with_the_key(folder):
    with pytest.raises(DataError, match=r"axes\.b\.command\.column: .*torque\.csv: no column 'i'"):
        described(folder, AXIS.replace("column: u", "column: i"))
    with pytest.raises(DataError, match=r"other\.csv: no such file"):
        described(folder, AXIS.replace("torque.csv", "other.csv"))
