"""Files that cannot be used: one DataError that says what, where and what would be right."""

import struct

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import example, given, settings
from hypothesis import strategies as st
from recorded_rows import AXES, columns, make_rows, write_log, write_table

from motorctl.errors import DataError
from motorctl.log import LogWriter, read_recording


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.parquet", b"\x89PNG\r\n\x1a\n0000", "is a PNG image, not a recording"),
        ("a.csv", b"\x89PNG\r\n\x1a\n0000", "is a PNG image, not a recording"),
        ("a.xlsx", b"PK\x03\x04....", "an Excel workbook or another ZIP archive"),
        ("a.parquet", b"time_s,x.position_m\n", "not a Parquet file: it begins with b'time'"),
        ("a.parquet", b"PAR1 cut", "a damaged Parquet file: its end is missing"),
        ("a.csv", b"", "the file is empty"),
        ("a.csv", b"PAR\0\1\2", "neither Parquet, MAT nor CSV"),
        ("a.csv", b"time_s,x\x01\n1,2\n", "not a text file: it has bytes that no text has"),
        ("a.csv", b"time_s,\x81\x8d\n1,2\n", "neither UTF-8, UTF-16 nor Windows-1252"),
        ("a.csv", b"\xff\xfea\x00\n\x00\x00\xd8", "not a text file in utf-16"),
        ("a.csv", b"time_s,x.position_m,x.command_v\n", "0 rows; at least 16"),
        ("a.csv", b"# only remarks\n", "no header line"),
        ("a.csv", b"0.1,0.2\n0.2,0.3\n", "line 1: numbers where the names"),
        ("a.mat", b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "not an HDF5 file, or a damaged one"),
        ("a.mat", b"\x89HDF\r\n\x1a\n", "not an HDF5 file, or a damaged one"),
        ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(300), "not a MAT file, or a damaged one"),
        ("a.mat", struct.pack("<5i", 2000, 3, 3, 0, 2) + bytes(74), "version 4 to 7: .* type 2000"),
        ("a.mat", struct.pack("<5i", 0, 3, 3, 0, 2) + bytes(73), "it ends within a matrix"),
        ("a.mat", struct.pack("<5i", 0, -3, 3, 0, 2), "a matrix of -3 rows"),
    ],
)
def test_a_file_that_is_no_recording_is_told_by_what_it_is(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(DataError, match=message) as refusal:
        read_recording(path)
    assert str(path) in str(refusal.value)


def test_a_missing_file_and_a_folder_are_told(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        read_recording(tmp_path / "none.csv")
    with pytest.raises(DataError, match="is a folder"):
        read_recording(tmp_path)


def test_an_unfinished_recording_says_how_to_recover_it(tmp_path):
    writer = LogWriter(tmp_path / "a.parquet", {}, AXES)
    writer.append(*make_rows(30))
    writer.flush()
    for path in (writer.path, writer.partial):
        with pytest.raises(DataError, match=r"motorctl log recover .*a\.parquet\.partial"):
            read_recording(path)
    writer.close({})


def test_a_damaged_log_is_told(tmp_path):
    path = write_log(tmp_path / "a.parquet", make_rows(2000))
    whole = path.read_bytes()
    path.write_bytes(whole[:4000] + b"\xff" * 2000 + whole[6000:])
    with pytest.raises(DataError, match="a damaged Parquet file"):
        read_recording(path)
    path.write_bytes(whole[:-100])
    with pytest.raises(DataError, match="its end is missing"):
        read_recording(path)


@pytest.mark.parametrize(
    ("rename", "message"),
    [
        ({"time_s": "t"}, r"no column 'time_s'\. There are: t, slide.position_m.*YAML description"),
        ({"slide.position_m": "q"}, r"no column '<axis>\.position_m'"),
        (
            {"slide.command_v": "slide.command"},
            r"did you mean 'slide\.command'\? There are: time_s",
        ),
    ],
)
def test_missing_columns_are_told_with_those_that_are_there(tmp_path, rename, message):
    table = {rename.get(name, name): values for name, values in columns().items()}
    with pytest.raises(DataError, match=message):
        read_recording(write_table(tmp_path / "a.csv", table))


def test_many_columns_are_not_all_listed(tmp_path):
    table = {f"c{k}": np.arange(20.0) for k in range(40)}
    with pytest.raises(DataError, match=r"c11 and 28 more"):
        read_recording(write_table(tmp_path / "a.parquet", table))


@pytest.mark.parametrize("suffix", ["csv", "parquet", "mat"])
@pytest.mark.parametrize(
    ("value", "words"), [(np.nan, "empty or not a number"), (-np.inf, "infinite")]
)
@pytest.mark.parametrize("signal", ["position_m", "command_v", "reference_m"])
def test_a_value_that_is_not_finite_is_told_with_its_row(tmp_path, suffix, value, words, signal):
    table = columns()
    table[f"slide.{signal}"][[30, 40]] = value
    message = rf"row 31.*column 'slide\.{signal}' is {words} \(2 such of 64 rows\)"
    with pytest.raises(DataError, match=message):
        read_recording(write_table(tmp_path / f"a.{suffix}", table))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0.05,abc,1,2", r"line 12: column 'slide\.position_m' is not a number: 'abc'"),
        ("0.05,,1,2", r"row 11 \(line 12\): column 'slide\.position_m' is empty"),
        ("0.05,1", "line 12: 2 values where the header has 4 columns"),
    ],
)
def test_a_damaged_line_of_a_csv_file_is_told_by_its_number(tmp_path, line, message):
    path = write_table(tmp_path / "a.csv", columns())
    lines = path.read_text().splitlines()
    lines[11] = line
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match=message):
        read_recording(path)


def test_a_column_name_that_stands_twice_is_refused(tmp_path):
    path = write_table(tmp_path / "a.csv", columns())
    path.write_text(path.read_text().replace("slide.command_v", "slide.position_m", 1))
    with pytest.raises(DataError, match=r"more than one column 'slide\.position_m'"):
        read_recording(path)


def test_columns_of_text_or_of_another_length_are_refused(tmp_path):
    table = columns() | {"slide.command_v": ["1"] * 64}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    with pytest.raises(DataError, match=r"'slide\.command_v' holds string, not numbers"):
        read_recording(tmp_path / "a.parquet")
    table = columns()
    fields = {"position_m": table["slide.position_m"], "command_v": np.zeros(60)}
    scipy.io.savemat(tmp_path / "a.mat", {"time_s": table["time_s"], "slide": fields})
    with pytest.raises(DataError, match=r"has 60 rows, but 'time_s' has 64"):
        read_recording(tmp_path / "a.mat")


@pytest.mark.parametrize("short", ["time_s", "slide.command_v"])
def test_of_columns_one_row_unlike_in_length_the_longer_ones_lose_their_last(tmp_path, short):
    table = columns() | {short: columns()[short][:-1]}
    np.savez(tmp_path / "a.npz", **table)
    np.savez(tmp_path / "b.npz", **{name: column[:63] for name, column in columns().items()})
    cut, whole = read_recording(tmp_path / "a.npz"), read_recording(tmp_path / "b.npz")
    np.testing.assert_array_equal(cut.time_s, whole.time_s)
    for field in ("position", "command", "reference"):
        of = (getattr(each.axes["slide"], field) for each in (cut, whole))
        np.testing.assert_array_equal(*of)
    longer = "slide.position_m" if short == "time_s" else "time_s"
    assert cut.notes == (
        f"column '{short}' has 63 rows, and '{longer}' 64: the last row of the longer ones was "
        "left out",
    )


def read_or_refuse(path):
    """Read; where that is refused, give the message."""
    try:
        read_recording(path)
    except DataError as refusal:
        return str(refusal)
    return str(path)


@settings(max_examples=200)
@given(
    data=st.binary(max_size=600),
    name=st.sampled_from(["a.csv", "a.parquet", "a.mat", "a.yaml", "a.bin"]),
    head=st.sampled_from(
        [
            b"",
            b"PAR1",
            b"\xff\xff\xff\xff",
            b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM",
            struct.pack("<5i", 0, 3, 3, 0, 2),
            b"time_s,x.position_m,x.command_v\n",
            b"file: a.csv\naxes:\n x: ",
        ]
    ),
)
def test_random_bytes_are_refused_and_never_a_traceback(tmp_path_factory, data, name, head):
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(head + data)
    message = read_or_refuse(path)
    assert str(path) in message
    assert len(message) < 3000


def test_a_damage_that_would_end_the_process_in_scipy_is_refused_before(tmp_path):
    path = write_table(tmp_path / "damaged.mat", columns())
    whole = path.read_bytes()
    array_class = 145  # in the first array's flags; scipy 1.17 ends with SIGSEGV on 255
    path.write_bytes(whole[:array_class] + b"\xff" + whole[array_class + 1 :])
    with pytest.raises(DataError, match=r"damaged\.mat: not a MAT file, or a damaged one"):
        read_recording(path)


@settings(max_examples=150)
@example(suffix="mat", share=0.08203125, patch=b"\x00", cut=False)  # a number beyond any square
@given(
    suffix=st.sampled_from(["csv", "parquet", "mat"]),
    share=st.floats(0, 1),
    patch=st.binary(max_size=12),
    cut=st.booleans(),
)
def test_damaged_files_are_refused_or_read_and_never_a_traceback(
    tmp_path_factory, suffix, share, patch, cut
):
    path = write_table(tmp_path_factory.getbasetemp() / f"damaged.{suffix}", columns())
    whole = path.read_bytes()
    at = round(share * len(whole))
    path.write_bytes(whole[:at] + patch + (b"" if cut else whole[at + len(patch) :]))
    message = read_or_refuse(path)
    assert str(path) in message
    assert len(message) < 3000
