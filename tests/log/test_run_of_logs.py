"""The logs of one run as one recording: as if it had never been cut, with its holes told."""

import json
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest
import typer
from mcap.reader import make_reader
from recorded_rows import AXES, make_rows
from typer.testing import CliRunner

from motorctl.cli import log as log_command
from motorctl.errors import DataError
from motorctl.identify.compare.runs import compare
from motorctl.log import LogWriter, memory_needed, read_recording
from motorctl.log.export import export
from motorctl.log.info import describe, describe_run
from motorctl.log.sample import FaultCause

ROWS = 6000
CUTS = (0, 1500, 1600, 4000, ROWS)
RUN = "bench-20260101T000000Z"
CONFIG = {"rate_hz": 1000.0, "axes": {"x": {}, "y": {}}}


def write_part(folder, rows, part, run=RUN, config=CONFIG, closing=None):
    """Write a part as the daemon does; its name is the time at which it began."""
    begin_s = int(rows[0]["tick"][0]) // 1000
    path = folder / f"bench-20260101T0000{begin_s:02d}Z-{part}.parquet"
    if part == 1:
        path = folder / f"{run}.parquet"
    metadata = {"rate_hz": 1000.0, "config": config, "run": run, "part": part}
    writer = LogWriter(path, metadata, AXES)
    writer.append(*rows)
    return writer.close({"rows_lost": part, "loop": {"part": part}, **(closing or {})})


@pytest.fixture
def rows():
    ticks, samples = make_rows(ROWS)
    samples["fault"][2500:, 1] = FaultCause.FOLLOWING_ERROR
    return ticks, samples


@pytest.fixture
def parts(tmp_path, rows):
    folder = tmp_path / "logs"
    folder.mkdir()
    spans = pairwise(CUTS)
    return [
        write_part(folder, (rows[0][a:b], rows[1][a:b]), k) for k, (a, b) in enumerate(spans, 1)
    ]


@pytest.fixture
def whole(tmp_path, rows):
    writer = LogWriter(tmp_path / "whole.parquet", {"rate_hz": 1000.0, "config": CONFIG}, AXES)
    writer.append(*rows)
    return writer.close({})


def same(found, wanted):
    assert found.sample_rate_hz == wanted.sample_rate_hz
    np.testing.assert_array_equal(found.time_s, wanted.time_s)
    np.testing.assert_array_equal(found.lateness_s, wanted.lateness_s)
    assert list(found.axes) == list(wanted.axes)
    for name, axis in wanted.axes.items():
        other = found.axes[name]
        for field in ("position", "command", "reference", "velocity", "state", "fault", "flags"):
            np.testing.assert_array_equal(getattr(other, field), getattr(axis, field))
        assert list(other.theta_hat) == list(axis.theta_hat)
        for theta, values in axis.theta_hat.items():
            np.testing.assert_array_equal(other.theta_hat[theta], values)


@pytest.mark.parametrize("how", ["parts", "shuffled", "folder", "name", "first", "third"])
def test_a_run_reads_as_the_log_that_was_never_cut(parts, whole, how):
    given, options = {
        "parts": (parts, {}),
        "shuffled": ([parts[2], parts[0], parts[3], parts[1]], {}),
        "folder": (parts[0].parent, {}),
        "name": (parts[0].parent / RUN, {}),
        "first": (parts[0], {"whole_run": True}),
        "third": ([parts[2]], {"whole_run": True}),
    }[how]
    found = read_recording(given, gaps="keep", **options)
    same(found, read_recording(whole, gaps="keep"))
    assert found.notes == ("4 logs (parts 1 to 4 of the run) as one recording",)
    assert found.source == str(parts[0].parent / RUN)
    assert found.metadata["rows"] == ROWS
    assert found.metadata["rows_lost"] == 1 + 2 + 3 + 4
    assert found.metadata["loop"] == {"part": 4}
    assert found.metadata["part"] == [1, 2, 3, 4]


def test_a_log_alone_is_read_alone(parts):
    assert len(read_recording(parts[1], gaps="keep").time_s) == CUTS[2] - CUTS[1]


def test_the_measures_of_a_run_are_those_of_the_uncut_log(parts, whole):
    run, uncut = (compare([read_recording(p, gaps="keep")]).runs[0] for p in (parts, whole))
    assert run.axes["x"].measures == uncut.axes["x"].measures


def test_a_part_that_is_missing_is_told_and_leaves_a_hole(parts):
    parts[2].unlink()
    found = read_recording(parts[0].parent, gaps="keep")
    assert found.notes[1] == (
        f"part 3 is missing between {parts[1].name} and {parts[3].name}: from 1.599 to 4 s nothing "
        "is known"
    )
    assert "2400 ticks are missing" in found.notes
    assert np.diff(found.time_s).max() == pytest.approx(2.401)
    assert len(found.time_s) == ROWS - 2400
    filled = read_recording(parts[0].parent)
    assert len(filled.time_s) == 2000  # the longest stretch without a hole
    assert any("the longest stretch" in note for note in filled.notes)


def test_logs_of_two_runs_are_not_one_recording(parts, rows):
    folder = parts[0].parent
    late = "bench-20260102T000000Z"
    other = write_part(folder, (rows[0][:100], rows[1][:100]), 1, run=late)
    with pytest.raises(DataError, match="give the logs of one run; `motorctl compare`"):
        read_recording([*parts, other])
    with pytest.raises(DataError, match=r"logs of 2 runs; name one: .*\(4 logs\), .*\(1 logs\)"):
        read_recording(folder)
    assert len(read_recording(folder / late).time_s) == 100
    assert len(read_recording(folder / RUN, gaps="keep").time_s) == ROWS


def test_what_cannot_be_one_recording_is_refused_with_the_reason(parts, rows, tmp_path, whole):
    some = (rows[0][CUTS[1] : CUTS[2]], rows[1][CUTS[1] : CUTS[2]])
    (tmp_path / "elsewhere").mkdir()
    copy = write_part(tmp_path / "elsewhere", some, 2)
    with pytest.raises(DataError, match="are both part 2 of the run"):
        read_recording([*parts, copy])
    changed = write_part(tmp_path / "elsewhere", some, 2, config={**CONFIG, "rate_hz": 500.0})
    with pytest.raises(DataError, match="recorded with different configurations"):
        read_recording([parts[0], changed])
    with pytest.raises(DataError, match="does not say which part of which run"):
        read_recording([parts[0], whole])
    with pytest.raises(DataError, match="--whole-run: it does not say"):
        read_recording(whole, whole_run=True)
    with pytest.raises(DataError, match=r"no such file, and no log in .* is of a run 'bench-1'"):
        read_recording(tmp_path / "bench-1")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="no logs of a daemon"):
        read_recording(tmp_path / "empty")
    shifted = make_rows(100, ticks=np.arange(1000, 1100))
    again = write_part(tmp_path / "elsewhere", shifted, 3)
    with pytest.raises(DataError, match=rf"{again.name}, row 1: column .* runs backwards"):
        read_recording([*parts[:2], again])


def test_a_part_that_is_still_recorded_is_left_out_and_told(parts, rows):
    folder = parts[0].parent
    partial = parts[3].with_name(parts[3].name + ".partial")
    parts[3].unlink()
    writer = LogWriter(parts[3], {"rate_hz": 1000.0, "config": CONFIG, "run": RUN, "part": 4}, AXES)
    writer.append(rows[0][CUTS[3] :], rows[1][CUTS[3] :])
    writer.flush()
    found = read_recording(folder, gaps="keep")
    assert partial.exists()
    assert len(found.time_s) == CUTS[3]
    assert "part 4 is left out" in found.notes[1]
    writer.close({})
    assert len(read_recording(folder, gaps="keep").time_s) == ROWS


def test_more_than_the_memory_holds_is_refused_before_it_is_read(parts, monkeypatch, tmp_path):
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal: 900 kB\nMemAvailable:     900 kB\n")
    monkeypatch.setattr(memory_needed, "_MEMINFO", meminfo)
    with pytest.raises(DataError, match=r"6000 rows of \d+ columns take .* give fewer parts"):
        read_recording(parts)
    assert len(read_recording(parts[1]).time_s) == 100


@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_a_run_is_exported_as_one_file(parts, to):
    path = export(parts, to, None, lambda _: None)
    assert path.name.startswith(f"{RUN}-parts-1-4.")
    found = read_recording(path, gaps="keep")
    np.testing.assert_array_equal(
        found.axes["x"].position, read_recording(parts, gaps="keep").axes["x"].position
    )
    # A run's export lies in its folder, and is no part of it.
    assert read_recording(parts[0], gaps="keep", whole_run=True).metadata["rows"] == ROWS


def test_a_run_is_one_file_of_messages_as_well(parts):
    path = export(parts, "mcap", None, lambda _: None)
    with path.open("rb") as file:
        told = make_reader(file).get_summary()
    assert told.statistics.message_count == 3 * ROWS
    assert (told.statistics.message_start_time, told.statistics.message_end_time) == (
        0,
        (ROWS - 1) * 1_000_000,
    )


def test_info_tells_a_run_with_its_faults_once(parts, whole):
    info = describe_run([parts[0].parent])
    uncut = describe(whole)
    assert (info.rows, info.begin_s, info.end_s) == (ROWS, 0.0, uncut.end_s)
    assert [(f.time_s, f.axis) for f in info.faults] == [(2.5, "y")]
    assert info.missed == uncut.missed
    assert info.size_bytes == sum(path.stat().st_size for path in parts)
    app = typer.Typer()
    app.callback()(lambda: None)
    log_command.register(app)
    shown = CliRunner().invoke(app, ["log", "info", str(parts[0]), "--whole-run"]).stdout
    assert f"parts 1 to 4 of the run {RUN}" in shown
    told = CliRunner().invoke(app, ["log", "info", *map(str, parts), "--json"]).stdout
    assert json.loads(told)["rows"] == ROWS
    assert pq.read_metadata(parts[1]).num_rows == 100
