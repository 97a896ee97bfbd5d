"""A bit of a log that changed on its disk: told with column and row group, never taken for data."""

import struct
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_rows import AXES, make_rows, write_log

from motorctl.daemon.recorded_rows import cut_rows
from motorctl.errors import DataError
from motorctl.flight.fault_moment import read_rows
from motorctl.latency.ticks import read_ticks
from motorctl.log import LogWriter, read_recording
from motorctl.log.convert import ROW_GROUP_ROWS
from motorctl.log.export import export
from motorctl.log.info import describe
from motorctl.log.open_table import open_table
from motorctl.log.parquet_pieces import ParquetPieces

ROWS = 70_000
"""Two row groups, and more than one page in the first."""
SHORT = 500
HEAD_BYTES = 40
"""The head of a page has about so many."""


@pytest.fixture(scope="module")
def whole_log(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("whole") / "a.parquet", make_rows(ROWS))


def place_of(path, name, group=0):
    """Where a column of a row group begins, and how many bytes it has."""
    told = pq.read_metadata(path).row_group(group)
    of = next(c for c in map(told.column, range(told.num_columns)) if c.path_in_schema == name)
    return min(filter(None, (of.dictionary_page_offset, of.data_page_offset))), (
        of.total_compressed_size
    )


def with_changed_bit(path, out, at, bit):
    whole = bytearray(path.read_bytes())
    whole[at] ^= 1 << bit
    out.write_bytes(whole)
    return out


@pytest.mark.parametrize("name", ["x.position_m", "tick"])
def test_no_bit_in_the_head_of_a_page_makes_other_rows_of_a_log(whole_log, tmp_path, name):
    truth = open_table(whole_log).column(name)
    begin, _ = place_of(whole_log, name)
    spoilt = tmp_path / "spoilt.parquet"
    spoilt.write_bytes(whole_log.read_bytes())
    table = open_table(spoilt)
    refused, told, where = 0, set(), f"column '{name}', row group 1 of 2"
    with spoilt.open("r+b", buffering=0) as file:
        for at in range(begin, begin + HEAD_BYTES):
            file.seek(at)
            (byte,) = file.read(1)
            for bit in range(8):
                file.seek(at)
                file.write(bytes([byte ^ (1 << bit)]))
                try:
                    np.testing.assert_array_equal(table.column(name), truth)
                except DataError as error:
                    refused += 1
                    told.add(str(error).partition(": a damaged Parquet file: ")[2][: len(where)])
            file.seek(at)
            file.write(bytes([byte]))
    assert told == {where}
    assert refused > 2 * HEAD_BYTES  # the others are of statistics, which nothing is read from


DOORS = {
    "recording": read_recording,
    "csv": lambda log: export([log], "csv", None, lambda _: None),
    "parquet": lambda log: export([log], "parquet", None, lambda _: None),
    "mat": lambda log: export([log], "mat", None, lambda _: None),
    "mcap": lambda log: export([log], "mcap", None, lambda _: None),
    "pieces": lambda log: [
        ParquetPieces(log).read(name, 66_000, 66_100) for name in open_table(log).names
    ],
    "pieces not held": lambda log: [
        ParquetPieces(log, held=False).read(name, 66_000, 66_100) for name in ("x.flags", "tick")
    ],
    "info": describe,
    "flight record": lambda log: read_rows(SimpleNamespace(path=log)),
    "latency": lambda log: read_ticks(
        SimpleNamespace(log=log, first_tick=0, last_tick=ROWS), "x", [1e-3]
    ),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("where", ["head", "data"])
def test_a_changed_bit_is_told_by_whatever_reads_the_log(
    whole_log, short_log, tmp_path, door, where
):
    whole, group, rows = whole_log, 1, ROWS - ROW_GROUP_ROWS
    if door == "mcap":  # a message a row and axis takes its time
        (whole, _, _), group, rows = short_log, 0, SHORT
    name = {"head": "tick", "data": "x.flags"}[where]
    if door == "recording":
        name = "x.position_m"
    begin, size = place_of(whole, name, group)
    at, bit = (begin + 1, 0) if where == "head" else (begin + size * 3 // 4, 3)
    log = with_changed_bit(whole, tmp_path / "log.parquet", at, bit)
    with pytest.raises(DataError) as refusal:
        DOORS[door](log)
    told = str(refusal.value)
    assert told.startswith(f"{log}: a damaged Parquet file: column '{name}', row group ")
    assert told.endswith("; copy it anew from where it was recorded, or have it from a backup")
    if where == "head":
        assert f"row group {group + 1} of {group + 1}, has 0 of its {rows} rows" in told
    assert [file.name for file in tmp_path.iterdir()] == ["log.parquet"]


@pytest.fixture(scope="module")
def short_log(tmp_path_factory):
    """A log, its bytes, where its end begins, and what it holds."""
    path = write_log(tmp_path_factory.mktemp("short") / "a.parquet", make_rows(SHORT))
    whole = path.read_bytes()
    footer = len(whole) - 8 - struct.unpack("<I", whole[-8:-4])[0]
    return path, footer, read_recording(path)


@settings(max_examples=40)
@given(part=st.floats(0.0, 1.0), bit=st.integers(0, 7))
def test_a_bit_that_changed_on_the_disk_is_told_and_never_taken_for_data(short_log, part, bit):
    path, footer, truth = short_log
    at = 4 + int(part * (footer - 5))
    spoilt = with_changed_bit(path, path.with_name("spoilt.parquet"), at, bit)
    found, told = truth, ""
    try:
        found = read_recording(spoilt)
    except DataError as error:
        told = str(error)
    assert not told or "a damaged Parquet file: column '" in told
    for name, axis in truth.axes.items():
        np.testing.assert_array_equal(found.axes[name].position, axis.position)
        np.testing.assert_array_equal(found.axes[name].command, axis.command)


def test_an_exported_log_has_checksums_as_well(whole_log, tmp_path):
    exported = export([whole_log], "parquet", tmp_path / "plain.parquet", lambda _: None)
    refuses_a_changed_bit(exported)


def test_rows_of_a_log_that_is_still_recorded_have_checksums_as_well(tmp_path):
    writer = LogWriter(tmp_path / "a.parquet", {}, AXES)
    writer.append(*make_rows(2000))
    writer.flush()
    refuses_a_changed_bit(cut_rows(writer.partial, 100, tmp_path / "cut.parquet"))
    writer.close({})


def refuses_a_changed_bit(log):
    begin, size = place_of(log, "x.theta_hat_inertia")
    spoilt = with_changed_bit(log, log.with_name("spoilt.parquet"), begin + size * 3 // 4, 2)
    with pytest.raises(DataError, match=r"'x\.theta_hat_inertia', row group 1 of "):
        open_table(spoilt).column("x.theta_hat_inertia")
