"""Rows that stand twice are left out; more than a few that only share a time are refused."""

import numpy as np
import pytest
from recorded_rows import sines, write_table

from motorctl.errors import DataError
from motorctl.log import read_recording


def with_times_twice(folder, rows, same=False):
    """Write 3000 samples; these rows stand twice, or another has their time and another command."""
    table = sines(0.005 * np.arange(3000))
    table = {name: np.insert(values, rows, values[rows]) for name, values in table.items()}
    again = np.asarray(rows) + np.arange(len(rows)) + 1
    if not same:
        table["x.command_v"][again] += 0.125
    write_table(folder / "a.csv", table)
    (folder / "a.yaml").write_text(
        "file: a.csv\ntime: {column: time_s}\naxes:\n  x:\n"
        "    position: {column: x.position_m, unit: m}\n"
        "    command: {column: x.command_v, unit: V}\n"
    )


@pytest.mark.parametrize("name", ["a.csv", "a.yaml"])
@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([700], "a row that repeats {}the one before left out, the first: row 702"),
        ([700, 700, 900], "3 rows that repeat {}the one before left out, the first: row"),
    ],
)
@pytest.mark.parametrize("same", [False, True])
def test_a_few_rows_that_stand_twice_are_left_out_and_told(tmp_path, name, rows, told, same):
    with_times_twice(tmp_path, rows, same)
    told = told.format("" if same else "the time of ")
    recording = read_recording(tmp_path / name)
    time_s = 0.005 * np.arange(3000)
    np.testing.assert_allclose(recording.time_s, time_s)
    np.testing.assert_allclose(recording.axes["x"].position, np.sin(6.0 * time_s), atol=1e-9)
    assert any(note.startswith(told) for note in recording.notes), recording.notes


def test_of_two_rows_of_one_time_the_first_is_kept(tmp_path):
    table = sines(0.005 * np.arange(3000))
    table = {name: np.insert(values, 700, values[700]) for name, values in table.items()}
    table["x.command_v"][700:702] = [2.0, 3.0]
    command = read_recording(write_table(tmp_path / "a.csv", table)).axes["x"].command
    assert command[700] == 2.0


TOO_MANY = [700, *range(900, 2100, 40)]


def test_a_recording_of_which_each_row_stands_twice_is_read(tmp_path):
    with_times_twice(tmp_path, list(range(3000)), same=True)
    recording = read_recording(tmp_path / "a.yaml")
    np.testing.assert_allclose(recording.time_s, 0.005 * np.arange(3000))
    assert any(n.startswith("3000 rows that repeat the one before") for n in recording.notes)


def test_more_than_one_row_in_a_hundred_that_shares_a_time_is_refused(tmp_path):
    with_times_twice(tmp_path, TOO_MANY)
    with pytest.raises(
        DataError, match=r"row 702 .* repeats 3\.5 .*; 31 of 3031 rows .* stand twice"
    ):
        read_recording(tmp_path / "a.yaml")


def test_the_rate_that_is_proposed_instead_knows_of_pauses(tmp_path):
    with_times_twice(tmp_path, TOO_MANY)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    header, rows = lines[0], [line.split(",") for line in lines[1:]]
    clock = header.split(",").index("time_s")
    for row in rows[2500:]:
        row[clock] = repr(float(row[clock]) + 7.0)
    (tmp_path / "a.csv").write_text("\n".join([header, *map(",".join, rows)]) + "\n")
    with pytest.raises(DataError, match=r"sample_rate_hz: 20[12]\.\d+, its rows over its time but"):
        read_recording(tmp_path / "a.yaml")
