"""Recovery: a damaged partial file gives a prefix of what was recorded, never a traceback."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_rows import AXES, make_rows

from motorctl.errors import DataError
from motorctl.log import LogWriter, read_recording, recover
from motorctl.log.convert import convert, load_metadata
from motorctl.log.partial import PartialFile

ROWS = 100
BATCH = 20


@pytest.fixture(scope="module")
def crashed(tmp_path_factory):
    """The bytes of a partial file with five batches, and the rows in it."""
    rows = make_rows(ROWS)
    writer = LogWriter(tmp_path_factory.mktemp("crash") / "run.parquet", {"seed": 5}, AXES)
    for first in range(0, ROWS, BATCH):
        writer.append(rows[0][first : first + BATCH], rows[1][first : first + BATCH])
        writer.flush()
    return writer.partial.read_bytes(), rows


def recovered(folder, data):
    """Recover from bytes; the number of rows, None where it was refused as a whole."""
    partial = folder / "run.parquet.partial"
    partial.write_bytes(data)
    try:
        done = recover(partial)
    except DataError:
        assert partial.read_bytes() == data
        assert not (folder / "run.parquet").exists()
        partial.unlink()
        return None
    assert not partial.exists()
    return done


def assert_prefix(path, count, rows):
    ticks, samples = rows
    table = pq.read_table(path)
    assert table.num_rows == count
    np.testing.assert_array_equal(table.column("tick").to_numpy(), ticks["tick"][:count])
    np.testing.assert_array_equal(
        table.column("y.position_m").to_numpy(), samples["position_m"][:count, 1]
    )
    np.testing.assert_array_equal(
        table.column("x.theta_hat_offset").to_numpy(), samples["theta_hat"][:count, 0, 1]
    )


@settings(max_examples=25)
@given(share=st.floats(0, 1))
def test_a_file_cut_at_any_byte_gives_every_whole_batch(tmp_path_factory, crashed, share):
    whole, rows = crashed
    cut = round(share * len(whole))
    done = recovered(tmp_path_factory.mktemp("cut"), whole[:cut])
    if done is not None:
        assert done.rows % BATCH == 0
        assert_prefix(done.path, done.rows, rows)
        lost = len(whole) - cut
        batch_bytes = (len(whole) - whole.index(b"crc32")) // 4
        assert ROWS - done.rows <= BATCH * (lost // batch_bytes + 2)


@settings(max_examples=300)
@given(share=st.floats(0, 1), patch=st.binary(min_size=1, max_size=64))
def test_bytes_that_changed_never_reach_the_log(tmp_path_factory, crashed, share, patch):
    whole, (ticks, samples) = crashed
    head = whole.index(b"crc32")
    begin = head + round(share * (len(whole) - head))
    partial = tmp_path_factory.getbasetemp() / "flipped.partial"
    partial.write_bytes((whole[:begin] + patch + whole[begin + len(patch) :])[: len(whole)])
    source = PartialFile(partial)
    for batch in source.batches():
        first = batch.column("tick")[0].as_py()  # ticks count rows here
        rows = slice(first, first + BATCH)
        np.testing.assert_array_equal(batch.column("tick").to_numpy(), ticks["tick"][rows])
        command = batch.column("y.command_v").to_numpy()
        np.testing.assert_array_equal(command, samples["command_v"][rows, 1])
    source.close()


@settings(max_examples=25)
@given(share=st.floats(0, 1), patch=st.binary(min_size=1, max_size=64))
def test_a_damaged_file_is_recovered_or_refused_and_then_kept(
    tmp_path_factory, crashed, share, patch
):
    whole, _ = crashed
    begin = round(share**3 * len(whole))  # the beginning matters most
    recovered(tmp_path_factory.mktemp("flip"), whole[:begin] + patch + whole[begin:])


def test_a_batch_with_wrong_content_is_left_out_and_later_ones_are_kept(tmp_path, crashed):
    whole, (_, samples) = crashed
    wrong = samples["position_m"][BATCH + 1, 1].tobytes()
    done = recovered(tmp_path, whole.replace(wrong, bytes(8), 1))
    assert done.tail_cut
    recording = pq.read_table(done.path, columns=["tick"])
    assert recording.column(0).to_pylist() == [*range(BATCH), *range(2 * BATCH, ROWS)]


def test_a_file_with_more_damage_than_a_torn_write_stays(tmp_path, crashed, monkeypatch):
    monkeypatch.setattr("motorctl.log.recovery.MOST_TORN_BYTES", 1000)
    partial = tmp_path / "run.parquet.partial"
    partial.write_bytes(crashed[0] + b"\xff" * 5000)
    done = recover(partial)
    assert (done.rows, done.partial_kept) == (ROWS, True)
    assert partial.exists()


@pytest.mark.parametrize("tail", [bytes(5000), b"\xff" * 5000, b"\xff\xff\xff\xff\x10\0\0\0"])
def test_rubbish_behind_the_last_batch_is_cut_off(tmp_path, crashed, tail):
    whole, rows = crashed
    done = recovered(tmp_path, whole + tail)
    assert done.rows == ROWS
    assert done.tail_cut
    assert_prefix(done.path, ROWS, rows)


def test_a_whole_file_is_recovered_whole_with_its_metadata(tmp_path, crashed):
    whole, rows = crashed
    done = recovered(tmp_path, whole)
    assert (done.rows, done.tail_cut) == (ROWS, False)
    assert_prefix(done.path, ROWS, rows)
    found = load_metadata(pq.read_schema(done.path))
    assert found["seed"] == 5
    assert found["recovered"] is True
    assert found["rows"] == ROWS
    assert read_recording(done.path).sample_rate_hz == 1000.0


@settings(max_examples=60)
@given(data=st.binary(max_size=400), head=st.sampled_from([b"", b"\xff\xff\xff\xff"]))
def test_random_bytes_are_refused_or_hold_no_rows(tmp_path_factory, data, head):
    assert recovered(tmp_path_factory.mktemp("random"), head + data) is None


def test_what_is_being_recorded_is_left_alone(tmp_path):
    writer = LogWriter(tmp_path / "run.parquet", {}, AXES)
    writer.append(*make_rows(30))
    writer.flush()
    with pytest.raises(DataError, match="is recording to it"):
        recover(writer.partial)
    assert len(read_recording(writer.close({})).time_s) == 30


def test_a_partial_file_beside_its_finished_log_is_only_removed(tmp_path, crashed):
    whole, _ = crashed
    partial = tmp_path / "run.parquet.partial"
    partial.write_bytes(whole)
    convert(partial, tmp_path / "run.parquet", {"closing": "kept"})
    done = recover(tmp_path / "run.parquet")
    assert done.was_finished
    assert done.rows == ROWS
    assert not partial.exists()
    assert load_metadata(pq.read_schema(done.path))["closing"] == "kept"


def test_another_recording_in_the_place_of_the_log_is_not_overwritten(tmp_path, crashed):
    whole, _ = crashed
    partial = tmp_path / "run.parquet.partial"
    partial.write_bytes(whole)
    other = tmp_path / "run.parquet"
    other.write_bytes(b"something else")
    with pytest.raises(DataError, match="another file is here"):
        recover(partial)
    assert other.read_bytes() == b"something else"
    assert recover(partial, tmp_path / "saved.parquet").rows == ROWS


def test_there_is_nothing_to_recover_in_a_finished_log(tmp_path, crashed):
    done = recovered(tmp_path, crashed[0])
    with pytest.raises(DataError, match="nothing to recover"):
        recover(done.path)


def test_a_partial_file_of_another_name_needs_a_name_for_its_log(tmp_path, crashed):
    odd = tmp_path / "copy.bin"
    odd.write_bytes(crashed[0])
    with pytest.raises(DataError, match="--out"):
        recover(odd)
    kept = shutil.copy(odd, tmp_path / "again.bin")
    assert recover(odd, tmp_path / "log.parquet").rows == ROWS
    assert recover(kept, tmp_path / "log2.parquet").rows == ROWS


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        recover(tmp_path / "none.parquet")


_RECORDS_AND_DIES = """
import os, signal, sys
from pathlib import Path
from recorded_rows import AXES, make_rows
from motorctl.log import LogWriter
writer = LogWriter(Path(sys.argv[1]), {"seed": 9}, AXES)
ticks, samples = make_rows(60)
writer.append(ticks[:50], samples[:50])
writer.flush()
writer.append(ticks[50:], samples[50:])
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_process_loses_only_what_was_not_flushed(tmp_path):
    path = tmp_path / "run.parquet"
    done = subprocess.run(
        [sys.executable, "-c", _RECORDS_AND_DIES, str(path)],
        cwd=Path(__file__).parents[1] / "support",
        check=False,
    )
    assert done.returncode == -signal.SIGKILL
    assert not path.exists()
    found = recover(path)
    assert (found.rows, found.tail_cut) == (50, False)
    assert read_recording(path).metadata["seed"] == 9
