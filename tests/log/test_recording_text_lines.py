"""Lines of a text file that are no rows are left out and told; messages name the right line."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from motorctl.errors import DataError
from motorctl.log import read_recording

SEPARATED = pytest.mark.parametrize("separator", [",", ";", "\t", " "])
ROWS = [(k / 100.0, round(np.sin(k / 20.0), 6), k % 7 - 3.0) for k in range(100)]
AXES = "axes:\n  b:\n    position: {column: q, unit: mm}\n    command: {column: u, unit: A}\n"


def lines_of(separator, rows=ROWS):
    return [separator.join(f"{value:.6f}" for value in row) for row in rows]


def read(folder, lines, separator=",", clock="time: {column: t}"):
    (folder / "a.csv").write_text("\n".join([separator.join("tqu"), *lines]) + "\n")
    (folder / "d.yaml").write_text(f"file: a.csv\n{clock}\n{AXES}")
    return read_recording(folder / "d.yaml")


def with_text(lines):
    """Put lines that are no rows among them: the first text stands in line 52 of the file."""
    return [*lines[:49], "", "WiFi lost", *lines[49:70], "hello there", *lines[70:]]


@SEPARATED
def test_lines_of_text_are_left_out_and_the_first_is_told_with_its_line(tmp_path, separator):
    recording = read(tmp_path, with_text(lines_of(separator)), separator)
    np.testing.assert_allclose(recording.axes["b"].command, [row[2] for row in ROWS])
    assert recording.notes == (
        "2 lines of text among the rows left out, the first line 52: 'WiFi lost'",
    )


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("text", ["# t#q#u", "t#q#u", "% 2 kHz, gains 5#3#1", "# off#0.5"])
def test_a_remark_or_header_among_the_rows_is_left_out_though_it_looks_like_a_row(
    tmp_path, separator, text
):
    """As a recorder writes its header behind a row that it had left from before."""
    told = text[0] + text[1:].replace("#", separator)
    lines = lines_of(separator)
    recording = read(tmp_path, [*lines[:1], told, *lines[1:]], separator)
    np.testing.assert_allclose(recording.axes["b"].command, [row[2] for row in ROWS])
    assert recording.notes == (f"a line of text among the rows left out, line 3: '{told}'",)


@pytest.mark.parametrize("row", ["t,0.1,0.2", "0.8,q,u", "t,q,0.2", "nan,q,u", "x1,0.1,"])
def test_a_row_of_which_some_cells_are_words_is_damaged_and_no_text(tmp_path, row):
    lines = lines_of(",")
    with pytest.raises(DataError, match=r"line 82: column .* is not a number"):
        read(tmp_path, [*lines[:80], row, *lines[80:]])


@pytest.mark.parametrize("row", ["0.8,None,None", "fault,fault,fault"])
def test_rows_without_a_number_are_damaged_as_the_rows_may_be_the_clock(tmp_path, row):
    lines = lines_of(",")
    with pytest.raises(DataError, match=r"line 82: column '[qu]' is not a number"):
        read(tmp_path, [*lines[:80], row, *lines[80:]], clock="sample_rate_hz: 100")


def test_rows_that_begin_with_the_mark_of_a_remark_are_rows(tmp_path):
    tagged = [f"#{k},{line}" for k, line in enumerate(lines_of(","))]
    (tmp_path / "a.csv").write_text("\n".join(["tag,t,q,u", *tagged, "tag,t,q,u"]) + "\n")
    (tmp_path / "d.yaml").write_text(f"file: a.csv\ntime: {{column: t}}\n{AXES}")
    recording = read_recording(tmp_path / "d.yaml")
    np.testing.assert_allclose(recording.axes["b"].command, [row[2] for row in ROWS])


@SEPARATED
@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0.1#0.2#0.3", r"row 81 \(line 85\): column 't' runs backwards"),
        ("0.8#abc#0.3", r"line 85: column 'q' is not a number: 'abc'"),
        ("0.8#inf#0.3", r"row 81 \(line 85\): column 'q' is infinite"),
        ("0.8#0.2", r"line 85: 2 values where the header has 3 columns"),
    ],
)
def test_a_damaged_row_behind_lines_of_text_is_told_by_its_line(tmp_path, separator, row, message):
    lines = lines_of(separator)
    lines[80] = row.replace("#", separator)
    with pytest.raises(DataError, match=message):
        read(tmp_path, with_text(lines), separator)


@pytest.mark.parametrize("cut", ["t", "t,0.99", "t,0.99,0.6"])
def test_a_cut_last_line_that_begins_with_the_word_of_every_row_is_left_out_and_told(tmp_path, cut):
    rows = [f"t,{line}" for line in lines_of(",")]
    (tmp_path / "a.csv").write_text("\n".join(["word,t,q,u", *rows, cut]))
    (tmp_path / "d.yaml").write_text(f"file: a.csv\ntime: {{column: t}}\n{AXES}")
    recording = read_recording(tmp_path / "d.yaml")
    assert len(recording.axes["b"].command) == len(ROWS)
    assert any("102" in note or "'t'" in note for note in recording.notes), recording.notes


@SEPARATED
@pytest.mark.parametrize("cut", ["0.99", "0.99#0.6", "0.99#-"])
def test_a_last_line_that_was_cut_is_left_out_and_told(tmp_path, separator, cut):
    """As a buffer that was not written to its end leaves it; the file ends there, too."""
    lines = lines_of(separator)
    lines[-1] = cut.replace("#", separator)
    recording = read(tmp_path, lines, separator)
    np.testing.assert_allclose(recording.axes["b"].command, [row[2] for row in ROWS[:-1]])
    assert recording.notes == ("the last line, 101, ends before its row does: left out",)


def test_a_last_row_whose_optional_column_is_empty_is_a_row(tmp_path):
    lines = [f"{line} start" for line in lines_of(" ")]
    lines[60:] = [line.removesuffix(" start") for line in lines[60:]]
    lines[0] = lines[0].replace("start", "0")
    header = " ".join("tqu") + " mark"
    (tmp_path / "a.csv").write_text("\n".join([header, *with_text(lines)]) + "\n")
    (tmp_path / "d.yaml").write_text(f"file: a.csv\ntime: {{column: t}}\n{AXES}")
    recording = read_recording(tmp_path / "d.yaml")
    np.testing.assert_allclose(recording.axes["b"].command, [row[2] for row in ROWS])
    assert not any("the last line" in note for note in recording.notes)


@pytest.mark.parametrize("day", ["2025-01-01 ", ""])
@pytest.mark.parametrize("cut", ["10:00:00.990", "10:00:00.990,0.6"])
def test_a_last_line_that_was_cut_behind_a_date_or_time_is_left_out(tmp_path, day, cut):
    lines = [f"{day}10:00:{t:06.3f},{q},{u}" for t, q, u in ROWS]
    lines[-1] = day + cut
    recording = read(tmp_path, lines)
    np.testing.assert_allclose(recording.axes["b"].command, [row[2] for row in ROWS[:-1]])
    assert "the last line, 101, ends before its row does: left out" in recording.notes


def test_a_damaged_row_behind_blank_lines_is_told_by_its_line(tmp_path):
    lines = lines_of(",")
    lines[80] = "0.1,0.2,0.3"
    lines.insert(50, "")
    with pytest.raises(DataError, match=r"row 81 \(line 83\)"):
        read(tmp_path, lines)


def test_rows_without_a_value_are_told_by_their_line(tmp_path):
    lines = lines_of(",")
    lines.insert(80, "nan,nan,nan")
    recording = read(tmp_path, with_text(lines))
    assert "1 row without a value left out, the first: row 81 (line 85)" in recording.notes


@SEPARATED
@pytest.mark.parametrize("cell", ["ovf ", "-ovf", "   ovf", "nan   "])
def test_what_cannot_be_printed_is_blank_with_blanks_about_it(tmp_path, separator, cell):
    lines = lines_of(separator)
    lines[30] = separator.join(["0.3", cell, "-1"])
    recording = read(tmp_path, lines, separator)
    assert recording.notes == (
        "1 of 100 values of column 'q' are blank: left out of every judgement",
    )


@SEPARATED
def test_a_file_of_text_alone_is_refused_with_its_first_line(tmp_path, separator):
    with pytest.raises(DataError, match=r"none of the 20 lines .* line 2 is 'hello to you'"):
        read(tmp_path, ["hello to you"] * 20, separator)


@pytest.mark.parametrize("clock", ["time: {column: t}", "sample_rate_hz: 100"])
@pytest.mark.parametrize("suffix", ["parquet", "csv"])
def test_a_file_without_rows_is_refused(tmp_path, clock, suffix):
    empty = pa.table({name: pa.array([], pa.float64()) for name in "tqu"})
    if suffix == "parquet":
        pq.write_table(empty, tmp_path / "a.parquet")
    else:
        (tmp_path / "a.csv").write_text("t,q,u\n")
    (tmp_path / "d.yaml").write_text(f"file: a.{suffix}\n{clock}\n{AXES}")
    with pytest.raises(DataError, match="0 rows; at least 16"):
        read_recording(tmp_path / "d.yaml")


def test_times_have_no_scale(tmp_path):
    lines = [f"2025-01-01 10:00:{row[0]:06.3f},{row[1]},{row[2]}" for row in ROWS]
    assert read(tmp_path, lines).sample_rate_hz == pytest.approx(100.0)
    with pytest.raises(DataError, match=r"d\.yaml: time\.scale: column 't' .* leave scale out"):
        read(tmp_path, lines, clock="time: {column: t, scale: 0.001}")
