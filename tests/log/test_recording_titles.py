"""Text files that begin with a title or settings, or have units below the names of columns."""

import numpy as np
import pytest

from motorctl.errors import DataError
from motorctl.log import read_recording

N = 40
TIME = np.arange(N) / 100.0
POSITION = np.round(np.sin(np.arange(N) / 9.0) * 1e-2, 6)
COMMAND = np.arange(N) % 7 - 3.0
ROWS = [f"{t:.2f},{x:.6f},{u:.1f}" for t, x, u in zip(TIME, POSITION, COMMAND, strict=True)]


def written(path, head, delimiter=",", decimal=".", rows=ROWS):
    """Write a file of head lines and rows."""
    turned = [row.replace(".", decimal).replace(",", delimiter) for row in rows]
    if decimal == ",":
        turned = [delimiter.join(cell.replace(".", ",") for cell in row.split(",")) for row in rows]
    path.write_text("\n".join([*head, *turned]) + "\n", encoding="utf-8")
    return path


def described(path, time="t", position="x", command="u", more=""):
    """Read a file by the names of its columns."""
    yaml = path.with_suffix(".yaml")
    yaml.write_text(
        f"file: {path.name}\ntime: {{column: '{time}', unit: s}}\n{more}axes:\n  x:\n"
        f"    position: {{column: '{position}', unit: m}}\n"
        f"    command: {{column: '{command}', unit: V}}\n"
    )
    return read_recording(yaml)


def check(recording):
    """Compare what was read with what was written."""
    np.testing.assert_allclose(recording.time_s, TIME)
    np.testing.assert_allclose(recording.axes["x"].position, POSITION)
    np.testing.assert_allclose(recording.axes["x"].command, COMMAND)


@pytest.mark.parametrize(
    ("head", "left_out"),
    [
        (["Motor test of March", "t,x,u"], [1]),
        (["t,x,u", "s,m,V"], [2]),
        (["t,x,u", "[s],[m],[V]"], [2]),
        (["t,x,u", "(s),(m),", ""], [2]),
        (["Instrument: X", "Date: 2024-03-01", "", "t,x,u", "sec,m,volts"], [1, 2, 5]),
        (["Model,MSO44", "Sample interval,0.01", "Firmware,1.2.3", "t,x,u"], [1, 2, 3]),
        (["Vertical Scale,0.5,0.5", "Label,position,drive", "t,x,u"], [1, 2]),
        (["Motor test,,", "t,x,u"], [1]),
        (["# saved by a scope", "Motor test", "t,x,u"], [2]),
        ([f"Setting {k},{k}" for k in range(90)] + ["t,x,u", "s,m,V"], [*range(1, 91), 92]),
    ],
)
@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", ".")])
def test_names_below_a_title_and_above_units_are_found(
    tmp_path, head, left_out, delimiter, decimal
):
    turned = [line.replace(",", delimiter) for line in head]
    recording = described(written(tmp_path / "a.csv", turned, delimiter, decimal))
    check(recording)
    (note,) = recording.notes
    assert f"line {head.index('t,x,u') + 1} names the columns" in note
    assert f"rows begin in line {len(head) + 1}" in note
    for line in left_out[:4]:
        assert f"{line} ('{turned[line - 1].strip()}')" in note


def test_a_plain_file_has_no_note(tmp_path):
    recording = described(written(tmp_path / "a.csv", ["t,x,u"]))
    check(recording)
    assert recording.notes == ()


@pytest.mark.parametrize("head", [["Motor test 5"], ["Motor test", "t,x,u"], ["A, B, C, D", ""]])
@pytest.mark.parametrize("delimiter", [",", " ", "\t"])
def test_columns_below_a_title_may_be_counted(tmp_path, head, delimiter):
    recording = described(written(tmp_path / "a.txt", head, delimiter), "1", "2", "3")
    check(recording)
    assert "columns are counted" in recording.notes[0]


UNCLEAR = ["Axis,Slide,Drive", "t,x,u"]


def test_of_two_lines_that_may_name_columns_the_one_that_has_them_does(tmp_path):
    check(described(written(tmp_path / "a.csv", UNCLEAR)))
    recording = described(written(tmp_path / "a.csv", UNCLEAR), "Axis", "Slide", "Drive")
    check(recording)
    assert "2 ('t,x,u') is not used" in recording.notes[0]


def test_where_it_is_not_clear_the_first_lines_are_shown_and_what_to_set(tmp_path):
    path = written(tmp_path / "a.csv", UNCLEAR)
    with pytest.raises(DataError) as refusal:
        described(path, position="Slide")
    told = str(refusal.value)
    assert "may stand in line 1 or 2" in told
    assert "header_line: 2" in told
    assert f"1: {UNCLEAR[0]}\n" in told
    assert f"3: {ROWS[0]}" in told
    with pytest.raises(DataError, match=r"no column 'Slide'.* There are: t, x, u"):
        described(path, position="Slide", more="header_line: 2\n")


@pytest.mark.parametrize("line", [2, 4])
def test_the_line_of_the_names_can_be_told(tmp_path, line):
    head = ["Motor test", "t,x,u", "Axis,Slide,Drive", "# t,x,u", "s,m,V"]
    recording = described(written(tmp_path / "a.csv", head), more=f"header_line: {line}\n")
    check(recording)
    assert f"line {line} names the columns" in recording.notes[0]


def test_a_name_without_values_has_no_column(tmp_path):
    """So does LabVIEW leave room for a comment."""
    head = ["LabVIEW Measurement", "Separator\tTab", "***End_of_Header***", "t\tx\tu\tComment"]
    path = written(tmp_path / "a.lvm", head, "\t")
    with pytest.raises(DataError, match=r"header_line: 4"):
        described(path)
    check(described(path, more="header_line: 4\n"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("header_line: 90\n", r"header_line is 90, but the file has 41 lines"),
        ("header_line: 0\n", r"yaml:3: header_line: .*greater than or equal to 1"),
        ("header_line: x\n", r"yaml:3: header_line: .*integer"),
    ],
)
def test_a_wrong_line_is_told(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        described(written(tmp_path / "a.csv", ["t,x,u"]), more=text)


def test_a_line_of_a_file_without_lines_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", t=TIME, x=POSITION, u=COMMAND)
    with pytest.raises(DataError, match=r"is no text file"):
        described(tmp_path / "a.npz", more="header_line: 1\n")


@pytest.mark.parametrize("row", ["0.00,abc,1", "0.00,NA,", "0.00,,"])
def test_a_damaged_first_row_is_a_row_all_the_same(tmp_path, row):
    path = written(tmp_path / "a.csv", ["t,x,u"], rows=[row, *ROWS[1:]])
    with pytest.raises(DataError, match=r"line 2\)?: column 'x' is"):
        described(path)
