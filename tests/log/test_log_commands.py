"""`motorctl log info`, `export` and `recover` on the command line."""

import json

import numpy as np
import pytest
import typer
from recorded_rows import AXES, columns, make_rows, write_log, write_table
from typer.testing import CliRunner

from motorctl.cli import log as command
from motorctl.errors import DataError, UsageError
from motorctl.log import LogWriter, read_recording
from motorctl.log.sample import FaultCause, SampleFlag

READ_ROWS = 65536
"""So many rows of Parquet are read at once."""


@pytest.fixture
def invoke():
    """Call the command as the command line does."""
    app = typer.Typer()
    app.callback()(lambda: None)
    command.register(app)

    def call(*arguments):
        return CliRunner().invoke(app, ["log", *map(str, arguments)], catch_exceptions=False)

    return call


@pytest.fixture
def crashed(tmp_path):
    """The partial file of a writer that was never closed."""
    writer = LogWriter(tmp_path / "run.parquet", {"seed": 4}, AXES)
    writer.append(*make_rows(100))
    writer.flush()
    kept = tmp_path / "crashed.parquet.partial"
    kept.write_bytes(writer.partial.read_bytes())
    writer.close({})
    return kept


def test_info_shows_rows_span_axes_and_faults(invoke, tmp_path):
    ticks, samples = make_rows(3000)
    samples["fault"][2000:, 1] = FaultCause.FOLLOWING_ERROR
    samples["fault"][2500:, 0] = FaultCause.ESTOP
    metadata = {"rate_hz": 1000.0, "machine": "bench"}
    path = write_log(tmp_path / "a.parquet", (ticks, samples), metadata)
    document = json.loads(invoke("info", path, "--json").stdout)
    assert document["rows"] == 3000
    assert document["axes"] == ["x", "y"]
    assert (document["begin_s"], document["end_s"]) == (0.0, 2.999)
    assert document["faults"] == [
        {"time_s": 2.0, "axis": "y", "cause": "FOLLOWING_ERROR", "device": []},
        {"time_s": 2.5, "axis": "x", "cause": "ESTOP", "device": []},
    ]
    assert document["metadata"]["machine"] == "bench"
    shown = invoke("info", path).stdout
    for part in (
        "3,000 rows",
        "1000 Hz",
        "machine: bench",
        "turnaround: median",
        "axis y: following error",
    ):
        assert part in shown


def test_info_of_an_unfinished_recording_says_what_to_do(invoke, crashed):
    shown = invoke("info", crashed).stdout
    assert "100 rows" in shown
    assert "not finished" in shown
    crashed.write_bytes(crashed.read_bytes()[:-10])
    assert "damaged" in invoke("info", crashed).stdout


@pytest.mark.parametrize("name", ["a.csv", "a.mat", "a.parquet"])
def test_info_of_a_foreign_recording(invoke, tmp_path, name):
    path = write_table(tmp_path / name, columns())
    document = json.loads(invoke("info", path, "--json").stdout)
    assert document["rows"] == 64
    assert document["sample_rate_hz"] == 200.0
    assert document["axes"] == ["slide"]


def test_info_of_no_recording_is_refused(invoke, tmp_path):
    (tmp_path / "a.csv").write_text("hello\nworld\n")
    for path in (tmp_path / "a.csv", tmp_path / "none.parquet"):
        with pytest.raises(DataError, match=str(path)):
            invoke("info", path)


@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_export_writes_beside_the_log_or_where_it_is_told(invoke, tmp_path, to):
    path = write_log(tmp_path / "a.parquet", make_rows(100))
    beside = invoke("export", path, "--to", to).stdout.strip()
    assert beside == str(tmp_path / ("a.export.parquet" if to == "parquet" else f"a.{to}"))
    out = tmp_path / f"other.{to}"
    told = json.loads(invoke("export", path, "--to", to, "--out", out, "--json").stdout)
    assert told == {"out": str(out)}
    np.testing.assert_array_equal(
        read_recording(out).axes["x"].position, read_recording(path).axes["x"].position
    )
    assert not list(tmp_path.glob("*.tmp"))


def test_export_never_overwrites_the_log(invoke, tmp_path):
    path = write_log(tmp_path / "a.parquet", make_rows(100))
    before = path.read_bytes()
    with pytest.raises(UsageError, match="would overwrite the log"):
        invoke("export", path, "--to", "parquet", "--out", path)
    assert path.read_bytes() == before


def test_export_tells_what_cannot_be_exported(invoke, tmp_path):
    foreign = write_table(tmp_path / "a.csv", columns())
    with pytest.raises(DataError, match="only logs"):
        invoke("export", foreign, "--to", "mat")
    path = write_log(tmp_path / "a.parquet", make_rows(100))
    with pytest.raises(UsageError, match="cannot be written"):
        invoke("export", path, "--to", "csv", "--out", foreign / "below.csv")
    assert invoke("export", path, "--to", "xls").exit_code == 2


def test_recover_tells_what_it_kept(invoke, crashed):
    crashed.write_bytes(crashed.read_bytes() + b"\xff\xff\xff\xff torn")
    shown = invoke("recover", crashed).stdout
    assert "crashed.parquet: 100 rows kept; the torn end of the file was dropped" in shown
    assert len(read_recording(crashed.with_suffix("")).time_s) == 100


def test_recover_gives_json_and_takes_another_name(invoke, crashed, tmp_path):
    out = tmp_path / "saved.parquet"
    document = json.loads(invoke("recover", crashed, "--out", out, "--json").stdout)
    assert document == {
        "path": str(out),
        "rows": 100,
        "tail_cut": False,
        "was_finished": False,
        "partial_kept": False,
        "was_closed": False,
    }
    assert read_recording(out).metadata["seed"] == 4


def test_info_tells_what_the_device_said_before_a_fault(invoke, tmp_path):
    stale, corrupt, switch = 256, 512, 64
    ticks, samples = make_rows(READ_ROWS + 100)
    samples["flags"] = 0
    samples["device_status"] = switch
    # Held from before the end of one batch into the next; what was told earlier is past.
    held = slice(READ_ROWS - 20, READ_ROWS + 30)
    samples["flags"][held, 0] = SampleFlag.HELD
    samples["device_status"][held, 0] = stale
    samples["device_status"][READ_ROWS - 15, 0] = stale | corrupt
    samples["fault"][READ_ROWS + 29 :, 0] = FaultCause.NO_NEW_SAMPLE
    names = {stale: "STALE", corrupt: "CORRUPT", switch: "LIMIT_NEGATIVE"}
    path = write_log(tmp_path / "run.parquet", (ticks, samples), {"device_statuses": names})
    (fault,) = json.loads(invoke("info", path, "--json").stdout)["faults"]
    assert fault["cause"] == "NO_NEW_SAMPLE"
    assert fault["device"] == ["STALE", "CORRUPT"]
    assert json.loads(invoke("info", path, "--json").stdout)["missed"] == {"x": 50, "y": 0}
    assert "axis x: 50 of" in invoke("info", path).stdout
    assert "no new sample (device: STALE, CORRUPT)" in invoke("info", path).stdout


def test_a_log_without_the_devices_word_tells_its_faults_all_the_same(invoke, tmp_path):
    ticks, samples = make_rows(100)
    samples["fault"][50:, 0] = FaultCause.ESTOP
    path = write_log(tmp_path / "run.parquet", (ticks, samples))
    (fault,) = json.loads(invoke("info", path, "--json").stdout)["faults"]
    assert (fault["cause"], fault["device"]) == ("ESTOP", [])


def test_info_tells_which_part_of_a_run_a_log_is_and_when_it_paused(invoke, tmp_path):
    part = {"run": "bench-1", "part": 2, "predecessor": "bench-1.parquet"}
    pauses = {"while": "every axis off", "count": 3, "seconds": 12.5, "last": []}
    ticks, samples = make_rows(40)
    ticks["tick"][20:] += 50
    ticks["time_s"] = ticks["tick"] / 1000
    closing = {"successor": "bench-3.parquet", "pauses": pauses}
    path = write_log(tmp_path / "bench-2.parquet", (ticks, samples), part, extra=closing)
    shown = invoke("info", path).stdout
    assert "part 2 of the run bench-1, after bench-1.parquet, before bench-3.parquet" in shown
    assert "paused 3 times, 12.5 s in all: every axis off" in shown
    assert "50 ticks are missing (skipped or lost, or left out in pauses)" in shown
