"""`motorctl fault`: what is kept of faults, listed, found, shown and drawn."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from matplotlib.image import imread
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import DataError, UsageError
from motorctl.flight import (
    find_record,
    free_record_path,
    later_than_all,
    list_records,
    load_record,
    remove_oldest,
)
from motorctl.log import LogAxis, LogWriter
from motorctl.log.sample import TICK_SAMPLE, AxisState, FaultCause, SampleFlag, axis_sample

RATE_HZ = 1000.0
ROWS = 500
FAULT_ROW = 400


def write_record(
    folder: Path,
    second: int = 0,
    cause: str = "overspeed",
    message: str = "speed 1.3 m/s, limit 1.2 m/s",
    second_axis: str = "y",
) -> Path:
    """Write a record of two axes as the daemon does; x trips in row FAULT_ROW."""
    ticks = np.zeros(ROWS, TICK_SAMPLE)
    ticks["tick"] = np.arange(ROWS)
    ticks["time_s"] = 7.0 + ticks["tick"] / RATE_HZ
    samples = np.zeros((ROWS, 2), axis_sample(1))
    samples["position_m"][:, 0] = 1e-4 * np.arange(ROWS)
    samples["position_m"][:, 1] = np.nan
    samples["state"] = AxisState.RUNNING
    samples["state"][FAULT_ROW:] = AxisState.FAULT
    samples["fault"][FAULT_ROW:, 0] = FaultCause.OVERSPEED
    samples["command_v"][:FAULT_ROW] = 9.9
    samples["flags"][:FAULT_ROW] = SampleFlag.SATURATED
    time_s = 7.0 + FAULT_ROW / RATE_HZ
    faults = {
        "x": {"cause": cause, "message": message, "time_s": time_s},
        "y": {"cause": "partner", "message": "partner x tripped", "time_s": time_s},
    }
    own = {
        "cause": cause,
        "message": faults["x"]["message"],
        "time_s": time_s,
        "written_utc": f"2026-11-24T10:00:{second:02d}.000+00:00",
        "faults": faults,
        "settings": {"before_s": 5.0, "after_s": 0.5},
        "libraries": {"numpy": "2"},
    }
    metadata: dict[str, Any] = {
        "machine": "bench",
        "rate_hz": RATE_HZ,
        "config": {"axes": {"x": {"limits": {"max_voltage_v": 10.0}}}},
        "flight_record": own,
    }
    when = datetime(2026, 11, 24, 10, 0, second, tzinfo=UTC)
    writer = LogWriter(
        free_record_path(folder, when, "x", cause),
        metadata,
        [LogAxis(name, ("inertia",)) for name in ("x", second_axis)],
    )
    writer.append(ticks, samples)
    return writer.close()


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["fault", *arguments])


def test_records_are_listed_newest_first_from_the_folder_of_the_logs(tmp_path: Path) -> None:
    paths = [write_record(tmp_path / "faults", second) for second in (5, 30, 12)]
    listing = list_records(tmp_path)
    assert [record.path for record in listing.records] == [paths[1], paths[2], paths[0]]
    assert list_records(tmp_path / "faults") == listing
    shown = run("list", "--log-dir", str(tmp_path))
    assert shown.exit_code == 0
    lines = shown.stdout.splitlines()
    assert lines[0] == "20261124T100030Z-x-overspeed  (and y)"
    assert lines[1].strip() == "speed 1.3 m/s, limit 1.2 m/s"
    document = json.loads(run("list", "--log-dir", str(tmp_path), "--json").stdout)
    assert [record["axis"] for record in document["records"]] == ["x"] * 3
    assert document["records"][0]["faults"]["y"]["cause"] == "partner"


def test_two_faults_in_a_second_have_two_names(tmp_path: Path) -> None:
    first, second = (write_record(tmp_path, 1) for _ in range(2))
    assert first != second
    assert len(list_records(tmp_path).records) == 2


def test_a_record_is_found_by_a_part_of_its_id_that_only_one_has(tmp_path: Path) -> None:
    write_record(tmp_path, 1)
    newest = write_record(tmp_path, 2, "soft_limit")
    listing = list_records(tmp_path)
    assert find_record(listing, None).path == newest
    assert find_record(listing, "soft").path == newest
    assert find_record(listing, newest.stem).path == newest
    with pytest.raises(UsageError, match="2 flight records have this in the id"):
        find_record(listing, "20261124")
    with pytest.raises(UsageError, match="no flight record has this in the id"):
        find_record(listing, "2027")


def test_what_cannot_be_read_is_told_and_hides_no_other_record(tmp_path: Path) -> None:
    good = write_record(tmp_path, 1)
    (tmp_path / "20261124T110000Z-x-estop.parquet").write_bytes(b"PAR1 torn")
    (tmp_path / "20261124T120000Z-x-estop.parquet.partial").write_bytes(b"half")
    listing = list_records(tmp_path)
    assert [record.path for record in listing.records] == [good]
    assert len(listing.broken) == 2
    assert "cannot be read as a log" in listing.broken[0]
    assert "motorctl log recover" in listing.broken[1]
    assert listing.broken[0] in run("list", "--log-dir", str(tmp_path)).stdout


@pytest.mark.parametrize(
    ("key", "value"),
    [("time_s", "soon"), ("time_s", None), ("message", None), ("faults", []), ("faults", {"x": 1})],
)
def test_a_record_that_says_nonsense_of_itself_is_told_in_words(
    tmp_path: Path, key: str, value: Any
) -> None:
    path = write_record(tmp_path, 1)
    table = pq.read_table(path)
    metadata = json.loads(table.schema.metadata[b"motorctl"])
    metadata["flight_record"][key] = value
    pq.write_table(table.replace_schema_metadata({b"motorctl": json.dumps(metadata)}), path)
    shown = run("show", "--log-dir", str(tmp_path))
    assert isinstance(shown.exception, UsageError)
    assert f"{key} is not what a recorder writes" in str(shown.exception)
    assert "no axis has tripped" not in run("list", "--log-dir", str(tmp_path)).stdout


def test_an_ordinary_log_is_no_flight_record(tmp_path: Path) -> None:
    writer = LogWriter(tmp_path / "run.parquet", {}, [LogAxis("x", ("inertia",))])
    writer.append(np.zeros(10, TICK_SAMPLE), np.zeros((10, 1), axis_sample(1)))
    with pytest.raises(DataError, match="is a log, but no flight record"):
        load_record(writer.close())


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    shown = run("list", "--log-dir", str(tmp_path / "nowhere"))
    assert isinstance(shown.exception, UsageError)
    assert str(tmp_path / "nowhere") in str(shown.exception)


def test_without_a_daemon_it_is_told_how_to_read_records(tmp_path: Path) -> None:
    shown = run("show", "--socket", str(tmp_path / "none.sock"))
    assert isinstance(shown.exception, UsageError)
    assert "--log-dir" in str(shown.exception)


def test_the_oldest_go_until_number_and_size_fit_and_the_newest_stays(tmp_path: Path) -> None:
    paths = [write_record(tmp_path, second) for second in range(4)]
    assert remove_oldest(tmp_path, keep=3, max_bytes=1e9) == [paths[0]]
    size = paths[3].stat().st_size
    assert remove_oldest(tmp_path, keep=9, max_bytes=1.5 * size) == [paths[2], paths[1]]
    assert remove_oldest(tmp_path, keep=1, max_bytes=1) == []
    assert [record.path for record in list_records(tmp_path).records] == [paths[3]]


def test_show_tells_the_tick_of_the_fault_and_the_one_before(tmp_path: Path) -> None:
    path = write_record(tmp_path)
    document = json.loads(run("show", str(path), "--json").stdout)
    moment = document["moment"]
    assert moment["time_s"] == pytest.approx(7.0 + FAULT_ROW / RATE_HZ)
    before, at = moment["before"]["x"], moment["at"]["x"]
    assert (before["state"], at["state"]) == ("running", "fault")
    assert before["values"]["position_m"] == pytest.approx(1e-4 * (FAULT_ROW - 1))
    assert (before["values"]["command_v"], at["values"]["command_v"]) == (9.9, 0.0)
    assert before["flags"] == ["saturated"]
    assert moment["at"]["y"]["values"]["position_m"] is None
    shown = run("show", str(path)).stdout
    assert "x: speed 1.3 m/s, limit 1.2 m/s" in shown
    assert "y: partner x tripped" in shown
    assert "9.900 V  saturated" in shown


@pytest.mark.slow
def test_show_draws_a_picture_of_each_axis(tmp_path: Path) -> None:
    write_record(tmp_path / "faults")
    shown = run("show", "--log-dir", str(tmp_path), "--out", str(tmp_path / "pictures"), "--json")
    pictures = json.loads(shown.stdout)["pictures"]
    assert [Path(picture).stem[-2:] for picture in pictures] == ["-x", "-y"]
    for picture in pictures:
        pixels = imread(picture)[..., :3]
        assert pixels.shape[0] > 800
        # The band of states is drawn: running before the fault, fault after it.
        assert np.any(np.all(np.abs(pixels - (0.553, 0.698, 0.553)) < 0.1, axis=-1))
        assert np.any(np.all(np.abs(pixels - (0.827, 0.576, 0.51)) < 0.1, axis=-1))


@pytest.mark.parametrize("under", ["file", "file/pictures"])
def test_a_folder_of_pictures_that_cannot_be_made_is_told_in_a_line(
    tmp_path: Path, under: str
) -> None:
    write_record(tmp_path / "faults")
    (tmp_path / "file").write_text("of somebody")
    shown = run("show", "--log-dir", str(tmp_path), "--out", str(tmp_path / under))
    assert isinstance(shown.exception, UsageError)
    assert f"{tmp_path / under}: pictures cannot be written" in str(shown.exception)
    assert "\n" not in str(shown.exception)


@pytest.mark.slow
@pytest.mark.parametrize("words", ["$\\frac{$", "a $ or $x_{$", "\x1b[2J\x07 speed", "wide " * 60])
def test_words_of_others_are_drawn_and_shown_as_they_are(tmp_path: Path, words: str) -> None:
    write_record(tmp_path / "faults", message=words)
    shown = run("show", "--log-dir", str(tmp_path), "--out", str(tmp_path / "pictures"))
    assert shown.exit_code == 0
    assert "\x1b" not in shown.stdout
    assert "\x07" not in shown.stdout
    pictures = sorted((tmp_path / "pictures").glob("*.png"))
    assert len(pictures) == 2
    sizes = {imread(picture).shape for picture in pictures}
    assert len(sizes) == 1  # a title of any length leaves the picture its size


def test_a_record_whose_axis_leads_a_picture_elsewhere_is_refused(tmp_path: Path) -> None:
    path = write_record(tmp_path / "faults", second_axis="../y")
    with pytest.raises(DataError, match="part of file names"):
        load_record(path)


def test_digits_that_are_no_time_keep_no_record_from_being_written(tmp_path: Path) -> None:
    (tmp_path / "99999999T999999Z-x-estop.parquet").write_text("of somebody")
    noon = datetime(2026, 1, 1, 12, tzinfo=UTC)
    assert later_than_all(tmp_path, noon) == noon
