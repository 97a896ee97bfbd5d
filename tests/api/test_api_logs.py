"""`motorctl.open_log` and `motorctl.simulate`: columns as arrays with units, whatever the file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from recorded_rows import AXES, columns, make_rows, write_csv, write_log, write_table

import motorctl
from motorctl.log import LogWriter

ROWS = make_rows(2000)


@pytest.fixture
def log(tmp_path: Path) -> motorctl.Log:
    write_log(tmp_path / "run.parquet", ROWS, {"rate_hz": 1000.0, "machine": "bench"})
    return motorctl.open_log(tmp_path / "run.parquet")


def test_columns_are_arrays_with_their_units(log: motorctl.Log) -> None:
    assert (log["x.position_m"] == ROWS[1]["position_m"][:, 0]).all()
    assert log.units["x.position_m"] == "m"
    assert log.units["y.command_v"] == "V"
    assert log.descriptions["x.following_error_m"] == "position - reference"
    assert log.axes == ("x", "y")
    assert (log.time_s == ROWS[0]["time_s"]).all()
    assert (log.rows, log.sample_rate_hz) == (2000, 1000.0)
    assert log.duration_s == pytest.approx(2.0)
    assert log.metadata["machine"] == "bench"
    with pytest.raises(ValueError, match="read-only"):
        log["x.position_m"][0] = 1.0


def test_a_column_is_read_when_it_is_asked_for_and_once(log: motorctl.Log) -> None:
    read = log["x.position_m"]
    log.paths[0].unlink()
    assert log["x.position_m"] is read
    with pytest.raises(motorctl.DataError, match=r"run\.parquet"):
        log["y.position_m"]


def test_a_column_that_is_not_there_is_told_beside_those_that_are(log: motorctl.Log) -> None:
    with pytest.raises(KeyError, match=r"no column 'x\.position'; there are: .*x\.position_m"):
        log["x.position"]
    with pytest.raises(motorctl.UsageError, match=r"no column 'z'"):
        log.to_pandas(["z"])


def test_a_frame_is_over_time_and_knows_its_units(log: motorctl.Log) -> None:
    frame = log.to_pandas(["x.position_m", "y.command_v"])
    assert list(frame.columns) == ["x.position_m", "y.command_v"]
    assert (frame.index.to_numpy(), frame.index.name) == (pytest.approx(log.time_s), "time_s")
    assert frame.attrs["units"] == {"x.position_m": "m", "y.command_v": "V"}
    assert len(log.to_pandas().columns) == len(log.columns) - 1


def test_what_a_stranger_wrote_into_a_log_is_text_in_a_notebook(tmp_path: Path) -> None:
    path = write_log(tmp_path / "run.parquet", ROWS, {"machine": "<script>alert(1)</script>"})
    html = motorctl.open_log(path)._repr_html_()
    assert "&lt;script&gt;" in html
    assert "<script>" not in html
    assert html.count("<polyline") == 4, "position and error of two axes"


def test_the_picture_keeps_a_peak_of_one_sample(tmp_path: Path) -> None:
    ticks, samples = make_rows(20_000)
    samples["following_error_m"][:] = 0.0
    samples["following_error_m"][12_345, 0] = 7e-6
    log = motorctl.open_log(write_log(tmp_path / "run.parquet", (ticks, samples)))
    html = log._repr_html_()
    assert "x following error, at most 7 µm" in html
    drawn = html.split("x following error")[1].split('points="')[1].split('"')[0]
    heights = {float(point.split(",")[1]) for point in drawn.split()}
    assert len(heights) == 2, "the ground, and the peak"


def test_a_log_that_is_being_recorded_opens_as_far_as_it_is_on_the_disk(tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / "run.parquet", {"rate_hz": 1000.0}, AXES)
    writer.append(ROWS[0][:500], ROWS[1][:500])
    writer.flush()
    log = motorctl.open_log(tmp_path / "run.parquet")
    assert log.paths == (writer.partial,)
    assert log.rows == 500
    assert (log["y.position_m"] == ROWS[1]["position_m"][:500, 1]).all()
    assert "not finished" in log.notes[0]
    writer.close({})


def test_the_logs_of_a_run_are_one(tmp_path: Path) -> None:
    for part, (a, b) in enumerate(((0, 700), (700, 2000)), 1):
        about = {"rate_hz": 1000.0, "config": {}, "run": "bench", "part": part}
        write_log(tmp_path / f"bench-{part}.parquet", (ROWS[0][a:b], ROWS[1][a:b]), about)
    whole = motorctl.open_log(tmp_path)
    assert (whole["x.position_m"] == ROWS[1]["position_m"][:, 0]).all()
    assert "2 logs" in whole.notes[0]
    one = motorctl.open_log(tmp_path / "bench-2.parquet", whole_run=True)
    assert (one.rows, one.info().rows) == (2000, 2000)


def test_a_run_of_many_logs_needs_few_open_files(tmp_path: Path) -> None:
    parts, rows = 100, 20
    write_log(tmp_path / "whole.parquet", make_rows(parts * rows), {"rate_hz": 1000.0})
    whole = pq.read_table(tmp_path / "whole.parquet")
    (tmp_path / "run").mkdir()
    for part in range(1, parts + 1):
        about = {"rate_hz": 1000.0, "config": {}, "run": "bench", "part": part}
        rows_of_part = whole.slice((part - 1) * rows, rows)
        pq.write_table(
            rows_of_part.replace_schema_metadata({b"motorctl": json.dumps(about)}),
            tmp_path / "run" / f"bench-{part:03}.parquet",
        )
    before = sum(1 for _ in Path("/proc/self/fd").iterdir())
    run = motorctl.open_log(tmp_path / "run")
    assert run.extremes("x.position_m").begins.tolist() == list(range(0, parts * rows, rows))
    assert run.part("tick", 10, 1990).tolist() == list(range(10, 1990))
    assert sum(1 for _ in Path("/proc/self/fd").iterdir()) <= before + 1
    (tmp_path / "run" / "bench-002.parquet").write_bytes(
        (tmp_path / "run" / "bench-003.parquet").read_bytes()
    )
    with pytest.raises(motorctl.DataError, match=r"bench-002\.parquet: is another file than when"):
        run.part("tick", 10, 30)


def test_a_foreign_recording_has_the_same_columns_in_its_own_units(tmp_path: Path) -> None:
    angle = np.linspace(0.0, 90.0, 64)
    table = {"t": np.arange(64) / 200, "angle": angle, "current": np.cos(angle)}
    write_csv(tmp_path / "spindle.csv", table)
    (tmp_path / "spindle.yaml").write_text(
        "file: spindle.csv\ntime: {column: t, unit: s}\naxes:\n  spindle:\n"
        "    position: {column: angle, unit: deg}\n    command: {column: current, unit: A}\n"
    )
    log = motorctl.open_log(tmp_path / "spindle.yaml")
    assert log["spindle.position_m"][-1] == pytest.approx(np.pi / 2)
    assert log.units["spindle.position_m"] == "rad"
    assert log.units["spindle.command_v"] == "A"
    assert log.sample_rate_hz == pytest.approx(200.0)
    plain = motorctl.open_log(write_table(tmp_path / "slide.mat", columns()))
    assert plain["slide.following_error_m"] == pytest.approx(-1e-3)


def test_a_simulation_gives_its_log_and_leaves_nothing_behind() -> None:
    told: list[float] = []
    log = motorctl.simulate("published_gantry", duration_s=1.0, seed=7, progress=told.append)
    assert log.duration_s >= 1.0
    assert told[-1] == 1.0
    assert log.metadata["seed"] == {"gantry": 7}
    assert log.units["y.theta_hat_inertia"] == "V*s^2/m"
    assert log.units["y.theta_hat_em_cubic"] == "1/V^2"
    path = log.paths[0]
    assert path.exists()
    del log
    assert not path.parent.exists()


def test_a_simulation_refuses_what_it_cannot_do() -> None:
    with pytest.raises(motorctl.UsageError, match=r"run\.csv: must end in \.parquet"):
        motorctl.simulate("small_stage", "run.csv")
    with pytest.raises(motorctl.ConfigError, match="no_such_machine"):
        motorctl.simulate("no_such_machine")
