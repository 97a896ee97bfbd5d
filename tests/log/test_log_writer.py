"""The log writer: what is appended is what a reader finds, whatever happens on the way."""

import dataclasses
import errno
import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_rows import AXES, make_rows, write_log

from motorctl.errors import RunError, UsageError
from motorctl.log import LogWriter, read_recording, recover
from motorctl.log import writer as writer_module
from motorctl.log.convert import load_metadata
from motorctl.log.info import describe
from motorctl.log.sample import AXIS_FIELDS


def column(path, name):
    return pq.read_table(path, columns=[name]).column(name).to_numpy()


def test_every_signal_reaches_its_column_bit_for_bit(tmp_path):
    ticks, samples = make_rows(300)
    samples["skew_m"] = np.linspace(-1e-3, 1e-3, 300)[:, None]
    samples["learned_v"] = np.linspace(-0.1, 0.1, 300)[:, None]
    beam, plain = dataclasses.replace(AXES[0], dual_drive=True, learning=True), AXES[1]
    path = write_log(tmp_path / "run.parquet", (ticks, samples), axes=(beam, plain))
    for name in ticks.dtype.names:
        np.testing.assert_array_equal(column(path, name), ticks[name])
    for j, axis in enumerate((beam, plain)):
        asked = {"dual_drive": axis is beam, "learning": axis is beam}
        others = {field.name for field in AXIS_FIELDS if not field.is_recorded(**asked)}
        for name in set(samples.dtype.names) - {"theta_hat"} - others:
            np.testing.assert_array_equal(column(path, f"{axis.name}.{name}"), samples[name][:, j])
        for k, theta in enumerate(axis.theta_names):
            found = column(path, f"{axis.name}.theta_hat_{theta}")
            np.testing.assert_array_equal(found, samples["theta_hat"][:, j, k])


def test_an_axis_has_columns_for_its_own_parameters_only(tmp_path):
    path = write_log(tmp_path / "run.parquet", make_rows(20))
    names = pq.read_schema(path).names
    assert "x.theta_hat_offset" in names
    assert "y.theta_hat_offset" not in names


def test_every_column_says_what_it_is_and_its_unit_where_it_has_one(tmp_path):
    schema = pq.read_schema(write_log(tmp_path / "run.parquet", make_rows(20)))
    assert all(schema.field(name).metadata[b"description"] for name in schema.names)
    assert schema.field("x.reference_velocity_m_s").metadata[b"unit"] == b"m/s"
    assert b"unit" not in schema.field("x.state").metadata


def test_append_copies_so_that_the_ring_may_be_overwritten(tmp_path):
    ticks, samples = make_rows(100)
    writer = LogWriter(tmp_path / "run.parquet", {}, AXES)
    wanted = samples["position_m"][:, 0].copy()
    writer.append(ticks, samples)
    samples["position_m"] = -1.0
    assert np.array_equal(column(writer.close({}), "x.position_m"), wanted)


@settings(max_examples=8)
@given(pieces=st.lists(st.integers(0, 9000), max_size=6), flushes=st.sets(st.integers(0, 5)))
def test_the_same_rows_make_the_same_file_however_they_came(tmp_path_factory, pieces, flushes):
    folder = tmp_path_factory.mktemp("same")
    ticks, samples = make_rows(20_000)
    fixed = {"host": "h", "started_utc": "s"}
    whole = write_log(folder / "whole.parquet", (ticks, samples), fixed)
    writer = LogWriter(folder / "pieces.parquet", fixed, AXES)
    done = 0
    for k, count in enumerate([*pieces, len(ticks)]):
        writer.append(ticks[done : done + count], samples[done : done + count])
        done = min(done + count, len(ticks))
        if k in flushes:
            writer.flush()
    assert writer.close({}).read_bytes() == whole.read_bytes()


def test_flushed_rows_can_be_read_by_any_arrow_reader_while_recording_goes_on(tmp_path):
    ticks, samples = make_rows(50)
    writer = LogWriter(tmp_path / "run.parquet", {}, AXES)
    writer.append(ticks, samples)
    writer.flush()
    with pa.memory_map(str(writer.partial)) as source:
        assert pa.ipc.open_stream(source).read_next_batch().num_rows == 50
    info = describe(writer.partial)
    assert (info.rows, info.finished) == (50, False)
    writer.close({})


def test_the_metadata_says_what_was_recorded(tmp_path):
    given_ = {"seed": 7, "config": {"rate_hz": 1000.0}}
    path = write_log(tmp_path / "run.parquet", make_rows(40), given_, extra={"rows_lost": 3})
    found = load_metadata(pq.read_schema(path))
    assert found["seed"] == 7
    assert found["rows"] == 40
    assert found["rows_lost"] == 3
    assert found["states"]["3"] == "RUNNING"
    assert found["faults"]["9"] == "ESTOP"
    assert found["axes"]["x"]["parameters"] == ["inertia", "offset"]
    assert {"version", "host", "started_utc"} <= found.keys()


def test_the_timing_summary_agrees_with_the_columns(tmp_path):
    ticks, samples = make_rows(5000)
    ticks["tick"][3000:] += 4
    ticks["turnaround_s"][1234] = 5e-4
    path = write_log(tmp_path / "run.parquet", (ticks, samples))
    timing = load_metadata(pq.read_schema(path))["timing"]
    assert timing["ticks_missing"] == 4
    found = timing["turnaround"]
    assert found["max_s"] == 5e-4
    assert found["max_at_s"] == ticks["time_s"][1234]
    for name, percentile in (("p50_s", 50), ("p99_s", 99), ("p999_s", 99.9)):
        exact = np.percentile(ticks["turnaround_s"], percentile)
        assert found[name] == pytest.approx(exact, rel=0.03)


def test_a_log_without_rows_is_a_log(tmp_path):
    path = LogWriter(tmp_path / "run.parquet", {}, AXES).close({})
    assert pq.read_metadata(path).num_rows == 0
    assert describe(path).rows == 0


def test_an_unfinished_recording_is_never_overwritten(tmp_path):
    path = tmp_path / "run.parquet"
    first = LogWriter(path, {}, AXES)
    first.append(*make_rows(30))
    first.flush()
    with pytest.raises(UsageError, match=r"log recover .*run\.parquet\.partial"):
        LogWriter(path, {}, AXES)
    assert first.close({}) == path


def test_a_place_that_cannot_be_written_is_told_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="the recording cannot be opened"):
        LogWriter(tmp_path / "file" / "run.parquet", {}, AXES)


def test_a_disk_that_is_full_from_the_start_leaves_no_file(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(writer_module.os, "write", full)
        with pytest.raises(UsageError, match="No space left"):
            LogWriter(tmp_path / "run.parquet", {}, AXES)
    assert list(tmp_path.iterdir()) == []


def test_rows_that_a_full_disk_refuses_are_counted_and_later_ones_are_kept(tmp_path, monkeypatch):
    writer = LogWriter(tmp_path / "run.parquet", {}, AXES)
    ticks, samples = make_rows(90)
    writer.append(ticks[:30], samples[:30])
    writer.flush()
    real_write = os.write
    budget = [1000]

    def full(handle, data):
        if budget[0] <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = real_write(handle, data[: budget[0]])
        budget[0] -= written
        return written

    writer.append(ticks[30:60], samples[30:60])
    with monkeypatch.context() as patch:
        patch.setattr(writer_module.os, "write", full)
        with pytest.raises(RunError, match="No space left"):
            writer.flush()
    writer.append(ticks[60:], samples[60:])
    path = writer.close({})
    assert column(path, "tick").tolist() == [*range(30), *range(60, 90)]
    assert load_metadata(pq.read_schema(path))["rows_lost"] == 30


def test_a_log_that_cannot_be_finished_leaves_what_was_recorded(tmp_path, monkeypatch):
    rows = make_rows(30)
    writer = LogWriter(tmp_path / "run.parquet", {}, AXES)
    writer.append(*rows)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("motorctl.log.synced.os.fsync", full)
        with pytest.raises(RunError, match=r"log recover"):
            writer.close({})
    assert not (tmp_path / "run.parquet").exists()
    assert recover(writer.partial).rows == 30
    assert len(read_recording(tmp_path / "run.parquet").time_s) == 30
