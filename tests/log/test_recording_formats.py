"""One recording, whatever file it stands in: logs, CSV, Parquet and MAT with a log's columns."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from recorded_rows import RATE_HZ, columns, make_rows, write_csv, write_log, write_table

from motorctl.errors import DataError
from motorctl.log import read_recording
from motorctl.log.export import export

N = 64


@pytest.mark.parametrize("name", ["run.csv", "run.parquet", "run.mat"])
def test_a_foreign_file_with_our_columns_is_used_as_it_is(tmp_path, name):
    table = columns()
    recording = read_recording(write_table(tmp_path / name, table))
    assert recording.sample_rate_hz == 200.0
    assert list(recording.axes) == ["slide"]
    axis = recording.axes["slide"]
    np.testing.assert_array_equal(axis.position, table["slide.position_m"])
    np.testing.assert_array_equal(axis.command, table["slide.command_v"])
    np.testing.assert_array_equal(axis.reference, table["slide.reference_m"])
    np.testing.assert_allclose(axis.following_error, -1e-3, rtol=1e-9)
    assert (axis.position_unit, axis.command_unit) == ("m", "V")
    assert axis.theta_hat == {}
    assert axis.state is None
    assert recording.metadata == {}
    assert recording.turnaround_s is None


def test_a_log_gives_every_signal_and_what_it_says_of_itself(tmp_path):
    ticks, samples = make_rows(N)
    config = {"axes": {"x": {"encoder": {"resolution_m": 5e-7}}}}
    metadata = {"rate_hz": RATE_HZ, "config": config}
    recording = read_recording(write_log(tmp_path / "a.parquet", (ticks, samples), metadata))
    assert recording.sample_rate_hz == RATE_HZ
    assert recording.duration_s == pytest.approx(N / RATE_HZ)
    assert recording.metadata["config"] == config
    np.testing.assert_array_equal(recording.turnaround_s, ticks["turnaround_s"])
    x, y = recording.axes["x"], recording.axes["y"]
    np.testing.assert_array_equal(x.theta_hat["offset"], samples["theta_hat"][:, 0, 1])
    np.testing.assert_array_equal(y.state, samples["state"][:, 1])
    np.testing.assert_array_equal(y.flags, samples["flags"][:, 1])
    np.testing.assert_array_equal(x.velocity, samples["velocity_m_s"][:, 0])
    assert (x.resolution, y.resolution) == (5e-7, None)


def test_of_a_log_no_more_than_the_signals_asked_for_is_read(tmp_path):
    log = write_log(tmp_path / "a.parquet", make_rows(N))
    whole = read_recording(log)
    part = read_recording(log, signals=("state", "lateness_s"))
    np.testing.assert_array_equal(part.time_s, whole.time_s)
    np.testing.assert_array_equal(part.lateness_s, whole.lateness_s)
    assert part.turnaround_s is None
    assert list(part.axes) == ["x", "y"]
    for name, axis in part.axes.items():
        for field in ("position", "command", "state"):
            np.testing.assert_array_equal(getattr(axis, field), getattr(whole.axes[name], field))
        assert (axis.reference, axis.velocity, axis.flags) == (None, None, None)
        assert axis.theta_hat == {}


def test_arrays_cannot_be_changed_by_accident(tmp_path):
    recording = read_recording(write_log(tmp_path / "a.parquet", make_rows(N)))
    axis = recording.axes["x"]
    for values in (recording.time_s, axis.position, axis.state, axis.theta_hat["inertia"]):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0


@pytest.mark.parametrize("names", [("x_{}",), ("x.{}",)])
def test_matlab_variables_may_carry_the_axis_in_their_name(tmp_path, names):
    table = {"time_s": np.arange(N) / 100.0}
    for signal in ("position_m", "command_v", "reference_m", "reference_velocity_m_s"):
        table[names[0].format(signal)] = np.arange(N) * 1.0
    scipy.io.savemat(tmp_path / "a.mat", table)
    axis = read_recording(tmp_path / "a.mat").axes["x"]
    assert axis.reference_velocity[-1] == N - 1


def test_what_cells_of_matlab_hold_can_be_named_as_iddata_keeps_its_signals(tmp_path):
    def cell(column):
        held = np.empty((1, 1), dtype=object)
        held[0, 0] = column[:, None]
        return held

    signals = {"OutputData": cell(np.arange(N) * 1e-3), "InputData": cell(np.arange(N) % 7 - 3.0)}
    scipy.io.savemat(tmp_path / "a.mat", {"d": signals})
    (tmp_path / "a.yaml").write_text(
        "file: a.mat\nsample_rate_hz: 100\naxes:\n  x:\n"
        "    position: {column: 'd.OutputData{1}', unit: m}\n"
        "    command: {column: 'd.InputData{1}', unit: V}\n"
    )
    axis = read_recording(tmp_path / "a.yaml").axes["x"]
    np.testing.assert_allclose(axis.position, np.arange(N) * 1e-3)
    np.testing.assert_allclose(axis.command, np.arange(N) % 7 - 3.0)


@pytest.mark.parametrize(
    ("delimiter", "decimal", "head"),
    [
        (";", ",", ""),
        ("\t", ".", ""),
        (" , ", ".", ""),
        (",", ".", "# made by a scope\n#second line\n"),
        (",", ".", "\n\n"),
        (",", ".", "\ufeff"),
    ],
)
def test_csv_dialects_are_understood(tmp_path, delimiter, decimal, head):
    table = columns()
    path = write_csv(tmp_path / "a.csv", table, delimiter, head, decimal)
    axis = read_recording(path).axes["slide"]
    np.testing.assert_array_equal(axis.position, table["slide.position_m"])


def test_decimal_commas_are_seen_behind_times_of_day_and_whole_numbers(tmp_path):
    """As a spreadsheet of a country with decimal commas writes them."""
    rows = ["clock;x;u", *(f"2018-05-26 10:13:15.{k:03d};0;{k % 7}" for k in range(20))]
    rows += [f"2018-05-26 10:13:15.{k:03d};{k},25;{k % 7}" for k in range(20, 500)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    (tmp_path / "a.yaml").write_text(
        "file: a.csv\ntime: {column: clock, unit: s}\naxes:\n  x:\n"
        "    position: {column: x, unit: mm}\n    command: {column: u, unit: V}\n"
    )
    axis = read_recording(tmp_path / "a.yaml").axes["x"]
    np.testing.assert_allclose(axis.position[20:], 1e-3 * (np.arange(20, 500) + 0.25))


def test_what_numpy_savetxt_writes_can_be_read(tmp_path):
    table = columns()
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack(list(table.values())), delimiter=",", header=",".join(table))
    np.testing.assert_allclose(read_recording(path).axes["slide"].command, table["slide.command_v"])


@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_an_exported_log_reads_as_the_log_itself(tmp_path, to):
    log = write_log(tmp_path / "a.parquet", make_rows(200, ticks=[*range(90), *range(93, 203)]))
    steps = []
    path = export([log], to, None, steps.append)
    assert steps[-1] == 1.0
    wanted, found = read_recording(log), read_recording(path)
    assert found.rows_filled == wanted.rows_filled == 3
    assert found.sample_rate_hz == wanted.sample_rate_hz
    np.testing.assert_array_equal(found.lateness_s, wanted.lateness_s)
    for name, axis in wanted.axes.items():
        other = found.axes[name]
        for field in ("position", "command", "reference", "velocity", "state", "flags", "fault"):
            np.testing.assert_array_equal(getattr(other, field), getattr(axis, field))
        for theta, values in axis.theta_hat.items():
            np.testing.assert_array_equal(other.theta_hat[theta], values)
    if to != "csv":
        assert found.metadata == wanted.metadata


def test_a_log_is_known_by_its_content_whatever_its_name(tmp_path):
    path = write_log(tmp_path / "run.log", make_rows(N))
    assert len(read_recording(path).time_s) == N


def test_integers_count_as_numbers(tmp_path):
    table = columns() | {"slide.position_m": np.arange(N)}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    assert read_recording(tmp_path / "a.parquet").axes["slide"].position[-1] == N - 1


def test_lines_of_a_serial_monitor_that_are_no_rows_are_left_out(tmp_path):
    """Blanks, a message; and an Arduino prints ovf for a number that is too large for it."""
    rows = [f"{k / 100},{0.1 * k:.3f},{-k}" for k in range(300)]
    rows[7] = "0.07, ovf,-7"
    rows[150:150] = ["  ", "Secure Edge Active"]
    (tmp_path / "a.csv").write_text("t,q,u\n" + "\n".join(rows) + "\n")
    (tmp_path / "d.yaml").write_text(
        "file: a.csv\ntime: {column: t}\naxes:\n  b:\n"
        "    position: {column: q, unit: mm}\n    command: {column: u, unit: A}\n"
    )
    recording = read_recording(tmp_path / "d.yaml")
    told = "a line of text among the rows left out, line 153: 'Secure Edge Active'"
    assert told in recording.notes
    axis = recording.axes["b"]
    np.testing.assert_allclose(axis.command, -np.arange(300.0))
    np.testing.assert_allclose(axis.position, 1e-4 * np.arange(300.0), atol=1e-12)
    rows[150] = "1.5,3"
    (tmp_path / "a.csv").write_text("t,q,u\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match="2 values where the header has 3 columns"):
        read_recording(tmp_path / "d.yaml")
