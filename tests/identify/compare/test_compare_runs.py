"""`motorctl compare`: runs side by side, their ratios and their pictures."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import typer
from matplotlib.figure import Figure
from recorded_rows import PERIOD_S, columns, make_rows, write_log, write_table
from typer.testing import CliRunner

from motorctl.cli import compare as command
from motorctl.errors import DataError, UsageError
from motorctl.identify.compare.measures import Measures
from motorctl.identify.compare.runs import compare, comparison_document, ratios
from motorctl.log import read_recording
from motorctl.picture_style import MOST_PIECES, colour, draw_curve

MODEL = {"inertia": {"bounds": [-4.0, 4.0]}, "offset": {"bounds": [-0.5, 0.5]}}


def log(path, error_m, controller="C1", **more):
    config = {
        "axes": {name: {"controller": controller, "program": "p", "model": MODEL} for name in "xy"},
        "programs": {"p": {"period_s": PERIOD_S}},
    }
    rows = make_rows(2000, error_m=error_m, **more)
    return write_log(path, rows, {"config": config, "rate_hz": 1000.0})


@pytest.fixture
def pair(tmp_path):
    """A run with 40 µm of error and one with 10 µm."""
    return log(tmp_path / "a.parquet", 4e-5, "C1"), log(tmp_path / "b.parquet", 1e-5, "C2")


@pytest.fixture
def invoke():
    """Call the command as the command line does."""
    app = typer.Typer()
    app.callback()(lambda: None)
    command.register(app)

    def call(*arguments):
        return CliRunner().invoke(app, ["compare", *map(str, arguments)], catch_exceptions=False)

    return call


def test_ratios_are_the_first_run_over_the_others(pair):
    comparison = compare([read_recording(path) for path in pair])
    (ratio,) = comparison.ratios("x")
    assert ratio["eM"] == pytest.approx(4.0)
    assert ratio["eF"] == pytest.approx(4.0)
    assert ratio["L2[e]"] == pytest.approx(4.0)
    assert ratio["uM"] == pytest.approx(1.0)
    assert [run.label for run in comparison.runs] == ["C1", "C2"]
    assert comparison.runs[0].axes["x"].period_from == "of the program"


def test_a_ratio_over_nothing_is_no_number_and_null_in_json(tmp_path):
    assert math.isnan(ratios(Measures(1, 1, 1, 1), Measures(0, 1, 1, 1))["eM"])
    paths = log(tmp_path / "a.parquet", 1e-5), log(tmp_path / "b.parquet", 0.0)
    document = comparison_document(compare([read_recording(path) for path in paths]))
    assert document["axes"]["x"]["ratios_first_over"][0]["eM"] is None
    json.dumps(document, allow_nan=False)


@pytest.mark.parametrize(
    ("names", "laws", "labels"),
    [
        (("a", "b"), ("C1", "C2"), ["C1", "C2"]),
        (("a", "b"), ("C2", "C2"), ["a", "b"]),
        (("one/run", "two/run"), ("C2", "C2"), ["one/run", "two/run"]),
    ],
)
def test_every_run_has_a_label_of_its_own(tmp_path, names, laws, labels):
    paths = [log(tmp_path / f"{n}.parquet", 1e-5, law) for n, law in zip(names, laws, strict=True)]
    comparison = compare([read_recording(path) for path in paths])
    found = [run.label.removeprefix(f"{tmp_path}/") for run in comparison.runs]
    assert found == labels


def test_the_same_file_twice_is_told_apart_by_number(pair):
    recording = read_recording(pair[0])
    assert [run.label for run in compare([recording, recording]).runs] == ["1 a", "2 a"]


def test_only_axes_that_all_runs_have_are_compared(tmp_path, pair):
    foreign = columns(2000)
    foreign = {name.replace("slide", "y"): values for name, values in foreign.items()}
    other = read_recording(write_table(tmp_path / "f.csv", foreign))
    comparison = compare([read_recording(pair[0]), other])
    assert comparison.axes == ("y",)
    assert [run.label for run in comparison.runs] == ["C1", "f"]


def test_runs_that_cannot_be_compared_are_refused(tmp_path, pair):
    first = read_recording(pair[0])
    table = columns()
    foreign = read_recording(write_table(tmp_path / "f.csv", table))
    with pytest.raises(DataError, match=r"no axis in common \(.*a\.parquet: x, y; .*f\.csv: slide"):
        compare([first, foreign])
    del table["slide.reference_m"]
    with pytest.raises(DataError, match="no axis has a reference"):
        compare([read_recording(write_table(tmp_path / "g.csv", table))])
    write_table(tmp_path / "h.csv", columns())
    axis = "{column: slide.position_m, unit: %s}"
    (tmp_path / "h.yaml").write_text(
        "file: h.csv\nsample_rate_hz: 200\naxes:\n  x:\n"
        f"    position: {axis % 'rad'}\n    reference: {axis % 'rad'}\n"
        "    command: {column: slide.command_v, unit: A}\n"
    )
    with pytest.raises(DataError, match=r"h\.yaml: axis x is in rad and A, but in m and V in"):
        compare([first, read_recording(tmp_path / "h.yaml")])


def test_the_command_prints_a_table_with_measures_ratios_and_notes(invoke, pair):
    result = invoke(*pair)
    assert result.exit_code == 0
    for part in ("Axis x", "eM µm", "L2[e] µm", "40.0", "10.0", "C1 / C2", "4.00", "period 0.5 s"):
        assert part in result.stdout
    assert "turnaround median" in result.stdout


@pytest.mark.slow
def test_the_command_gives_one_json_document_and_pictures(invoke, pair, tmp_path):
    result = invoke(*pair, "--out", tmp_path / "pictures", "--json")
    document = json.loads(result.stdout)
    assert [r["label"] for r in document["recordings"]] == ["C1", "C2"]
    assert document["recordings"][0]["timing"]["turnaround"]["worst_s"] > 0
    first = document["axes"]["y"]["runs"][0]
    assert first["eM"] == pytest.approx(4e-5, rel=1e-3)
    assert first["period_s"] == PERIOD_S
    made = {p.rpartition("/")[2] for p in document["pictures"]}
    kinds = ("tracking_error", "command", "estimates")
    assert made == {f"{kind}_{axis}.png" for kind in kinds for axis in "xy"} | {"turnaround.png"}
    for path in document["pictures"]:
        assert Path(path).read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


@pytest.mark.slow
def test_pictures_are_drawn_for_many_runs_and_for_poor_ones(invoke, tmp_path):
    paths = [log(tmp_path / f"r{k}.parquet", 1e-5 * k) for k in range(5)]
    still = {name: np.zeros(64) for name in columns()} | {"time_s": columns()["time_s"]}
    still = {name.replace("slide", "x"): values for name, values in still.items()}
    paths.append(write_table(tmp_path / "still.csv", still))
    result = invoke(*paths, "--out", tmp_path / "p")
    assert result.exit_code == 0
    assert "still" in result.stdout


def test_a_period_may_be_given(invoke, pair):
    document = json.loads(invoke(*pair, "--period", "0.25", "--json").stdout)
    run = document["axes"]["x"]["runs"][0]
    assert (run["period_s"], run["period_from"]) == (0.25, "as given")


@pytest.mark.parametrize("period", ["0", "-1", "nan", "inf"])
def test_a_period_that_is_none_is_refused(invoke, pair, period):
    with pytest.raises(UsageError, match="--period"):
        invoke(*pair, f"--period={period}")


def test_pictures_that_cannot_be_written_are_told(invoke, pair):
    with pytest.raises(UsageError, match="pictures cannot be written"):
        invoke(*pair, "--out", pair[0] / "below")


def test_rows_lost_in_a_long_gap_do_not_hide_the_rest(invoke, tmp_path):
    ticks = np.r_[0:1000, 1500:2500]
    path = log(tmp_path / "gap.parquet", 1e-5, ticks=ticks)
    result = invoke(path)
    assert "500 ticks are missing" in result.stdout


def test_a_long_curve_keeps_its_peaks_in_few_points():
    values = np.zeros(1_000_000)
    values[123_456], values[777_777] = 5.0, -3.0
    panel = Figure().add_subplot()
    draw_curve(panel, np.arange(1e6), values, colour(0))
    drawn = panel.lines[0].get_ydata()
    assert (drawn.max(), drawn.min()) == (5.0, -3.0)
    assert len(drawn) <= 2 * MOST_PIECES
