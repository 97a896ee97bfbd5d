"""Signals that stand in files of their own are read beside each other, row by row."""

from datetime import datetime, timedelta

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


ROW_OF_NONE = np.array([np.nan])
OTHERS_CLOCK = AXIS.replace("column: u", "column: v")  # of a file whose clock has another name
NO_CLOCK = "no clock was compared"


def write_dated(path, name, moments, values):
    rows = [f"{moment},{value}" for moment, value in zip(moments, values, strict=True)]
    path.write_text("\n".join([f"t,{name}", *rows]) + "\n")


def moments_from(begin):
    begin = datetime.fromisoformat(begin)
    return [(begin + timedelta(seconds=s)).isoformat(timespec="milliseconds") for s in TIME_S]


def with_line(path, line, text):
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[: line - 1], text, *lines[line - 1 :]]) + "\n")


def test_a_row_of_blanks_does_not_let_rows_of_another_time_pass(folder):
    write(folder / "speed.csv", "t,w", np.r_[TIME_S, ROW_OF_NONE], np.r_[SPEED, ROW_OF_NONE])
    late = np.r_[TIME_S + 0.1, ROW_OF_NONE]
    write(folder / "torque.csv", "t,u", late, np.r_[TORQUE, ROW_OF_NONE])
    with pytest.raises(DataError, match=r"torque\.csv: row 1 .*'t' is 0\.1, and 0 in the first"):
        described(folder)
    write(folder / "torque.csv", "t,u", np.r_[TIME_S, ROW_OF_NONE], np.r_[TORQUE, ROW_OF_NONE])
    assert len(described(folder).time_s) == N


@pytest.mark.parametrize("blank", [slice(N - 1, N), slice(None)], ids=["last", "all"])
def test_a_blank_time_beside_one_that_is_none_is_refused(folder, blank):
    time_s = TIME_S.copy()
    time_s[blank] = np.nan
    write(folder / "torque.csv", "t,u", time_s, TORQUE)
    with pytest.raises(
        DataError, match=r"torque\.csv: row \d+ .*'t' is blank, and 0.* in the first"
    ):
        described(folder)


@pytest.mark.parametrize(
    ("begin", "message"),
    [
        (
            "2025-01-01 11:00:00",
            r"row 1 .*'t' is 3600, and 0 in the first file \(seconds from 2025",
        ),
        ("2025-01-02 10:00:00", r"row 1 .*'t' is 86400, and 0 in the first file"),
        ("2025-01-01 10:00:00+01:00", "a clock of another kind"),
    ],
)
def test_dates_that_begin_at_another_time_are_refused(folder, begin, message):
    first = moments_from("2025-01-01 10:00:00")
    write_dated(folder / "speed.csv", "w", first, SPEED)
    write_dated(folder / "torque.csv", "u", first, TORQUE)
    np.testing.assert_allclose(described(folder).axes["b"].command, TORQUE)
    write_dated(folder / "torque.csv", "u", moments_from(begin), TORQUE)
    with pytest.raises(DataError, match=message):
        described(folder)


def test_a_clock_of_dates_beside_one_of_seconds_is_refused(folder):
    write_dated(folder / "speed.csv", "w", moments_from("2025-01-01 10:00:00"), SPEED)
    with pytest.raises(DataError, match=r"torque\.csv numbers and .*speed\.csv 2025-01-01T10"):
        described(folder)


def test_files_of_as_many_rows_without_a_common_clock_are_read_and_that_is_told(folder):
    write(folder / "torque.csv", "s,v", TIME_S, TORQUE)
    recording = described(folder, OTHERS_CLOCK)
    np.testing.assert_allclose(recording.axes["b"].command, TORQUE)
    assert NO_CLOCK in recording.notes[0]
    recording = described(folder, OTHERS_CLOCK.replace("time: {column: t}", "sample_rate_hz: 200"))
    assert NO_CLOCK in recording.notes[0]


@pytest.mark.parametrize("rows", [N - 1, N + 1])
def test_files_of_other_rows_without_a_common_clock_are_refused(folder, rows):
    time_s = np.arange(rows) / 200.0
    write(folder / "torque.csv", "s,v", time_s, time_s)
    with pytest.raises(DataError, match=rf"torque\.csv: has {rows} rows, and .*csv 100; no clock"):
        described(folder, OTHERS_CLOCK)


@pytest.mark.parametrize("damaged", ["speed.csv", "torque.csv"])
@pytest.mark.parametrize(("line", "text"), [(50, "WiFi lost"), (N + 2, "0.5")])
def test_lines_that_are_no_rows_are_refused_without_a_common_clock(folder, damaged, line, text):
    write(folder / "torque.csv", "s,v", TIME_S, TORQUE)
    with_line(folder / damaged, line, text)
    with pytest.raises(DataError, match=rf"{damaged}: a line is no row of numbers, and no clock"):
        described(folder, OTHERS_CLOCK)


def test_a_line_of_text_is_told_with_its_file_where_the_times_agree(folder):
    with_line(folder / "torque.csv", 50, "WiFi lost")
    recording = described(folder)
    np.testing.assert_allclose(recording.axes["b"].command, TORQUE)
    told = "torque.csv: a line of text among the rows left out, line 50: 'WiFi lost'"
    assert recording.notes[0] == told


def test_every_signal_may_stand_in_a_file_of_its_own(folder):
    text = AXIS.replace("time: {column: t}", "sample_rate_hz: 200")
    text = text.replace("{column: w", "{file: velocity.csv, column: w")
    write(folder / "velocity.csv", "t,w", TIME_S, SPEED)
    recording = described(folder, text)
    np.testing.assert_allclose(recording.axes["b"].command, TORQUE)
    assert recording.notes[0].startswith("the rows of torque.csv stand beside those of velocity.")


def test_columns_of_another_file_that_are_counted_are_no_clock(tmp_path):
    write(tmp_path / "speed.csv", "", TIME_S, SPEED)
    write(tmp_path / "torque.csv", "", TORQUE)
    text = AXIS.replace("column: t", 'column: "1"').replace("column: w", 'column: "2"')
    recording = described(tmp_path, text.replace("column: u", 'column: "1"'))
    np.testing.assert_allclose(recording.axes["b"].command, TORQUE)


def test_the_header_of_each_file_is_found_by_its_own_columns(folder):
    """As an oscilloscope writes settings above it, as wide as its rows are."""
    rows = (folder / "torque.csv").read_text().partition("\n")[2]
    (folder / "torque.csv").write_text(f"Model,X\nSource,u\nt,u\n{rows}")
    np.testing.assert_allclose(described(folder).axes["b"].command, TORQUE)


def test_a_header_of_units_is_found_where_the_clock_has_another_name(folder):
    write(folder / "torque.csv", "s,Nm", TIME_S, TORQUE)
    recording = described(folder, AXIS.replace("column: u", "column: Nm"))
    np.testing.assert_allclose(recording.axes["b"].command, TORQUE)


def test_header_line_is_that_of_the_first_file(folder):
    speed = (folder / "speed.csv").read_text()
    (folder / "speed.csv").write_text(f"Model,X\nSource,Y\n{speed}")
    recording = described(folder, f"header_line: 3\n{AXIS}")
    np.testing.assert_allclose(recording.axes["b"].command, TORQUE)


def test_messages_about_a_cell_name_the_file_where_it_stands(folder):
    rows = (folder / "torque.csv").read_text().partition("\n")[2]
    bad = rows.splitlines()
    bad[10] = bad[10].partition(",")[0] + ",inf"
    (folder / "torque.csv").write_text("\n".join(["a title", "t,u", *bad]) + "\n")
    with pytest.raises(
        DataError, match=r"torque\.csv: row 11 \(line 13\): column 'torque\.csv: u'"
    ):
        described(folder)


def test_a_damaged_position_of_another_file_is_told_with_its_line_there(folder):
    positions = np.sin(TIME_S * 20.0)
    positions[40] = 1e6
    write(folder / "place.csv", "a title\nt,x", TIME_S, positions)
    text = AXIS.replace(
        "velocity: {column: w, unit: rad/s}", "position: {file: place.csv, column: x, unit: m}"
    )
    recording = described(folder, text)
    assert any("row 41 (line 43) is 1e+06" in note for note in recording.notes)


def test_times_in_another_file_are_no_command(folder):
    moments = moments_from("2025-01-01 10:00:00")
    rows = [f"{t},{moment}" for t, moment in zip(TIME_S, moments, strict=True)]
    (folder / "torque.csv").write_text("\n".join(["t,u", *rows]) + "\n")
    with pytest.raises(
        DataError, match=r"'torque\.csv: u' of .*torque\.csv has times where numbers"
    ):
        described(folder)
