"""MATLAB's objects, as a timeseries or Simulink's output: what they hold can be read.

scipy writes no objects, so the bytes are put together here as MATLAB does: a reference where the
variable is, and a MAT file within the file that has the values in cells.
"""

import contextlib
import io
import struct

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st

from motorctl.errors import DataError
from motorctl.log import read_recording
from motorctl.log.table_mat import MatTable

N = 64
RATE_HZ = 100.0
REFERENCE = np.array([[0xDD000000, 2, 1, 1, 1, 1]], np.uint32).T
MATRIX, OPAQUE = 14, 17
PLACE = np.arange(N) * 1e-3
VOLTS = np.arange(N) % 7 - 3.0


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def opaque(name, kind, held):
    """Return an array of class opaque; what it holds comes last, without a name."""
    flags = element(6, struct.pack("<II", OPAQUE, 0))
    texts = b"".join(element(1, text) for text in (name, b"MCOS", kind))
    return element(MATRIX, flags + texts + array("", held))


def array(name, value):
    """Return an array as scipy writes it."""
    file = io.BytesIO()
    scipy.io.savemat(file, {name or "a": value})
    content = file.getvalue()[128:]
    if name:
        return content
    return content.replace(struct.pack("<HHI", 1, 1, ord("a")), struct.pack("<II", 1, 0), 1)


def cells(*values):
    held = np.empty((len(values), 1), dtype=object)
    for row, value in enumerate(values):
        held[row, 0] = value
    return held


def mat_with_objects(*held):
    """Return a MAT file with a plain variable, an object, and what objects hold."""
    names = b"MCOS".ljust(8, b"\0")
    within = element(6, struct.pack("<II", 2, 0))  # a struct
    within += element(5, struct.pack("<ii", 1, 1)) + struct.pack("<II", 1, 0)
    within += struct.pack("<HHI", 5, 4, 8) + element(1, names)
    values = cells(np.zeros((40, 1), np.uint8), *held)
    within = element(MATRIX, within + opaque(b"", b"FileWrapper__", values))
    nameless = np.frombuffer(b"\x00\x01IM\0\0\0\0" + within + array("", [[1, 2]]), np.uint8)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    reference = opaque(b"out", b"timeseries", REFERENCE)
    return head + array("plain", np.arange(N) * 1.0) + reference + array("", nameless[None, :])


OUT = {"pos": np.column_stack([np.arange(N) / RATE_HZ, PLACE]), "u": VOLTS[:, None]}


def test_what_objects_hold_is_counted_and_the_fields_of_structs_are_named(tmp_path):
    (tmp_path / "a.mat").write_bytes(mat_with_objects(OUT, REFERENCE, PLACE[:, None]))
    assert MatTable(tmp_path / "a.mat").names == (
        "plain",
        "objects{1}.pos(:,1)",
        "objects{1}.pos(:,2)",
        "objects{1}.u",
        "objects{3}",
    )
    (tmp_path / "a.yaml").write_text(
        "file: a.mat\ntime: {column: 'objects{1}.pos(:,1)'}\naxes:\n  x:\n"
        "    position: {column: 'objects{1}.pos(:,2)', unit: m}\n"
        "    command: {column: 'objects{1}.u', unit: V}\n"
    )
    axis = read_recording(tmp_path / "a.yaml").axes["x"]
    np.testing.assert_array_equal(axis.position, PLACE)
    np.testing.assert_array_equal(axis.command, VOLTS)


@given(at=st.integers(128, 2500), value=st.integers(0, 255))
def test_a_damaged_file_with_objects_is_read_or_refused(tmp_path_factory, at, value):
    content = bytearray(mat_with_objects(OUT, PLACE[:, None]))
    content[at % len(content)] = value
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    path.write_bytes(content)
    with contextlib.suppress(DataError):  # nothing but this may come of it
        MatTable(path)


def test_a_file_of_objects_that_hold_no_vector_says_which_columns_there_are(tmp_path):
    (tmp_path / "a.mat").write_bytes(mat_with_objects(REFERENCE))
    with pytest.raises(DataError, match="There are: plain"):
        MatTable(tmp_path / "a.mat").read(["out"])
