"""Recordings in HDF5: what h5py writes, and MATLAB's save -v7.3."""

import sys

import h5py
import hdf5storage
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.errors import DataError
from motorctl.log import read_recording

N = 64
POSITION = np.sin(np.arange(N) / 9.0) * 1e-2
COMMAND = np.arange(N) % 7 - 3.0


def described(path, position, command):
    """Read a file by the names of two of its columns."""
    yaml = path.with_suffix(".yaml")
    yaml.write_text(
        f"file: {path.name}\nsample_rate_hz: 100\naxes:\n  x:\n"
        f"    position: {{column: '{position}', unit: m}}\n"
        f"    command: {{column: '{command}', unit: V}}\n"
    )
    axis = read_recording(yaml).axes["x"]
    np.testing.assert_allclose(axis.position, POSITION)
    np.testing.assert_allclose(axis.command, COMMAND)


def matlab(file, name, values, told="double"):
    """Write an array as MATLAB does: by columns, with its class beside it."""
    array = np.asarray(values)
    array = array[:, None] if array.ndim == 1 else array
    stored = file.create_dataset(name, data=array.T)
    stored.attrs["MATLAB_class"] = np.bytes_(told)
    return stored


def matlab_file(path):
    """Open a new file that begins as MATLAB's do."""
    h5py.File(path, "w", userblock_size=512).close()
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\0\2IM")
    return h5py.File(path, "r+")


@pytest.mark.parametrize(
    ("position", "command"),
    [
        ("run/Y", "run/deep/U"),
        ("tall[:,0]", "tall[:,1]"),
        ("wide[0,:]", "wide[1,:]"),
        ("table.q", "table.uv[:,1]"),
        ("narrow", "whole"),
    ],
)
def test_columns_are_named_by_their_path(tmp_path, position, command):
    path = tmp_path / "a.h5"
    both = np.column_stack([POSITION, COMMAND])
    records = np.zeros(N, [("q", "f8"), ("uv", "f4", (2,))])
    records["q"], records["uv"][:, 1] = POSITION, COMMAND
    with h5py.File(path, "w") as file:
        file["run/Y"], file["run/deep/U"] = POSITION, COMMAND[:, None]
        file.create_dataset("tall", data=both, chunks=True, compression="gzip")
        file["wide"], file["table"] = both.T, records
        file["narrow"], file["whole"] = POSITION, COMMAND.astype("i1")
        file["title"] = "a text"
        file["nowhere"] = h5py.SoftLink("/not/there")
        file["run/again"] = file["run"]
    described(path, position, command)


@pytest.mark.parametrize(
    ("position", "command"),
    [
        ("q", "u"),
        ("both(:,1)", "both(:,2)"),
        ("rows(1,:)", "rows(2,:)"),
        ("run.Y.signal", "run.U"),
        ("d.OutputData{1}", "d.InputData{1}"),
        ("s(1).Data", "s(2).Data"),
        ("objects{1}", "objects{2}.inner"),
    ],
)
def test_what_matlab_saves_as_hdf5_is_named_as_in_other_mat_files(tmp_path, position, command):
    path = tmp_path / "a.mat"
    both = np.column_stack([POSITION, COMMAND])
    with matlab_file(path) as file:
        matlab(file, "q", POSITION)
        matlab(file, "u", COMMAND[None, :])
        matlab(file, "both", both, "single")
        matlab(file, "rows", both.T)
        matlab(file, "run/Y/signal", POSITION)
        matlab(file, "run/U", COMMAND.astype("i2"), "int16")
        matlab(file, "title", np.frombuffer(b"a title", np.uint8).astype("u2")[None, :], "char")
        matlab(file, "none", np.zeros(2, "u8")).attrs["MATLAB_empty"] = np.uint8(1)
        held = matlab(file, "#refs#/a", POSITION), matlab(file, "#refs#/b", COMMAND)
        matlab(file, "#refs#/c/inner", COMMAND)
        head = matlab(file, "#refs#/d", np.zeros(9, np.uint8), "uint8")
        for name, one in zip(("d/OutputData", "d/InputData"), held, strict=True):
            cell = file.create_dataset(name, (1, 1), h5py.ref_dtype)
            cell[0, 0] = one.ref
            cell.attrs["MATLAB_class"] = np.bytes_("cell")
        field = file.create_dataset("s/Data", (2, 1), h5py.ref_dtype)  # a 1x2 array of structs
        field[:, 0] = [one.ref for one in held]
        for name in ("run", "run/Y", "d", "s", "#refs#/c"):
            file[name].attrs["MATLAB_class"] = np.bytes_("struct")
        of_objects = file.create_dataset("#subsystem#/MCOS", (1, 3), h5py.ref_dtype)
        of_objects[0, :] = [head.ref, held[0].ref, file["#refs#/c"].ref]
        refers = matlab(file, "ts", np.array([0xDD000000, 2, 1, 1, 1, 1], "u4"), "timeseries")
        refers.attrs["MATLAB_object_decode"] = np.int32(3)
    described(path, position, command)


@pytest.mark.parametrize(
    ("position", "command"),
    [("q", "u"), ("both(:,1)", "both(:,2)"), ("run.Y", "run.U"), ("cells{1}", "cells{2}")],
)
def test_another_writer_of_matlabs_format_is_read_alike(tmp_path, position, command):
    path = tmp_path / "a.mat"
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = POSITION[:, None], COMMAND[:, None]
    content = {
        "q": POSITION[:, None],
        "u": COMMAND[None, :],
        "both": np.column_stack([POSITION, COMMAND]),
        "run": {"Y": POSITION[:, None], "U": COMMAND[:, None]},
        "cells": cells,
        "text": "a text",
    }
    hdf5storage.savemat(str(path), content, format="7.3", store_python_metadata=False)
    described(path, position, command)


def test_matlab_variables_may_carry_the_axis_in_their_name(tmp_path):
    with matlab_file(tmp_path / "a.mat") as file:
        matlab(file, "time_s", np.arange(N) / 100.0)
        matlab(file, "x_position_m", POSITION)
        matlab(file, "x_command_v", COMMAND)
    np.testing.assert_array_equal(read_recording(tmp_path / "a.mat").axes["x"].command, COMMAND)


def test_a_wrong_name_is_told_with_those_that_there_are(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/Y"], file["run/U"] = POSITION, COMMAND
    with pytest.raises(DataError, match=r"no column 'run/X'; did you mean 'run/Y'\?"):
        described(tmp_path / "a.h5", "run/X", "run/U")


def test_without_the_library_the_extra_is_told(tmp_path, monkeypatch):
    path = tmp_path / "a.mat"
    matlab_file(path).close()
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(DataError, match=r"pip install 'motorctl\[hdf5\]', or in MATLAB .* -v7"):
        read_recording(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a sound file."""
    path = tmp_path_factory.mktemp("whole") / "a.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = np.arange(N) / 100.0
        file["x.position_m"], file["x.command_v"] = POSITION, COMMAND
    return path.read_bytes()


@settings(max_examples=60)
@given(share=st.floats(0, 1))
def test_a_file_that_was_cut_is_refused_or_read_and_never_a_traceback(
    tmp_path_factory, whole, share
):
    path = tmp_path_factory.getbasetemp() / "cut.h5"
    path.write_bytes(whole[: round(share * len(whole))])
    assert str(path) in read_or_refuse(path)


def read_or_refuse(path):
    """Read; where that is refused, give the message."""
    try:
        return read_recording(path).source
    except DataError as refusal:
        return str(refusal)
