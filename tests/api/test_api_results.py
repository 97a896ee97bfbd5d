"""`motorctl.fit`, `.diagnose`, `.refine` and `.compare`: results for scripts and notebooks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fit_plant import X_THETA
from fit_plant import simulate as plant
from recorded_rows import PERIOD_S, make_rows, write_log
from refine_bench import gantry_diagnosis, gantry_log
from typer.testing import CliRunner

import motorctl
from motorctl.cli import make_app
from motorctl.config import load
from motorctl.identify.diagnose import recording as diagnosing


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the x axis, as a log of the published gantry."""
    made = plant(seed=1, duration_s=6.0)
    table = pa.table(
        {"time_s": made.time_s, "x.position_m": made.position, "x.command_v": made.command}
    )
    about = {"rate_hz": made.rate_hz, "config": load("published_gantry").resolved}
    path: Path = tmp_path_factory.mktemp("fit") / "run.parquet"
    pq.write_table(table.replace_schema_metadata({"motorctl": json.dumps(about)}), path)
    return path


@pytest.fixture
def known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log of the gantry of which the diagnosis knows the truth, without a search."""
    log: Path = gantry_log(tmp_path, 1.0)

    def diagnose(recording, models, *_, **__):  # type: ignore[no-untyped-def]
        return gantry_diagnosis(log, axes=tuple(models))

    monkeypatch.setattr(diagnosing, "diagnose_recording", diagnose)
    return log


def test_a_fit_gives_the_parameters_as_array_frame_and_document(run: Path) -> None:
    told: list[str] = []
    found = motorctl.fit(motorctl.open_log(run), model="C2", progress=told.append)
    axis = found.axes["x"]
    assert np.abs(axis.theta[:3] / X_THETA[:3] - 1.0).max() < 0.1
    frame = found.to_pandas()
    assert list(frame["parameter"]) == list(axis.model.parameter_names)
    assert frame["value"].to_numpy() == pytest.approx(axis.theta)
    assert frame["std_error"].to_numpy() == pytest.approx(axis.std_error)
    assert frame["unit"][0] == "V*s^2/m"
    assert told == ["fitting axis x"]
    html = found._repr_html_()
    assert all(name in html for name in axis.model.parameter_names)
    printed = CliRunner().invoke(make_app(), ["fit", str(run), "--model", "C2", "--json"]).stdout
    assert json.loads(printed) == json.loads(json.dumps(found.to_dict()))


def test_settings_of_a_fit_are_keys_of_its_settings_file(run: Path) -> None:
    options = motorctl.fit(run, settings={"filter_hz": 70.0, "decimation": 5}).axes["x"].options
    assert (options.filter_hz, options.decimation) == (70.0, 5)
    with pytest.raises(motorctl.UsageError, match="filter_kHz"):
        motorctl.fit(run, settings={"filter_kHz": 1})


def test_a_diagnosis_tells_effects_and_parameters_in_a_frame_and_a_notebook(
    known: Path, tmp_path: Path
) -> None:
    found = motorctl.diagnose(known, axis="x")
    frame = found.to_pandas()
    assert set(frame["effect"]) == {"cogging", "input_lag", "input_delay"}
    pitch = frame[frame["parameter"] == "pitch_m"].iloc[0]
    assert (pitch["value"], pitch["unit"]) == (0.05, "m")
    assert (pitch["axis"], pitch["verdict"], pitch["confidence"]) == ("x", "effect", 0.99)
    html = found._repr_html_()
    assert "axis x: told in one sentence" in html
    assert "cogging" in html
    assert "it is seen" in html
    page, *_ = found.write_report(tmp_path / "report", "machine.yaml")
    assert "--config machine.yaml" in page.read_text()


def test_a_refinement_stands_in_its_file_and_says_what_was_changed(
    known: Path, tmp_path: Path
) -> None:
    told: list[str] = []
    refined = motorctl.refine(
        motorctl.open_log(known),
        "published_gantry",
        tmp_path / "new.yaml",
        axis="x",
        progress=lambda what, _: told.append(what),
    )
    assert refined.changed
    assert "cogging" in load(refined.out).axes["x"].model.names
    assert "+      cogging:" in refined.diff
    assert "cogging" in refined._repr_html_()
    assert refined.to_dict()["axes"]["x"]["effects_added"][0] == "cogging"
    assert told == ["reading", "refining"]


def test_a_comparison_is_a_row_for_each_axis_and_run(tmp_path: Path) -> None:
    config = {
        "axes": {name: {"controller": "C1", "program": "p"} for name in "xy"},
        "programs": {"p": {"period_s": PERIOD_S}},
    }
    paths = [
        write_log(tmp_path / f"{name}.parquet", make_rows(2000, error_m=error), {"config": config})
        for name, error in (("before", 4e-5), ("after", 1e-5))
    ]
    compared = motorctl.compare(motorctl.open_log(paths[0]), paths[1])
    frame = compared.to_pandas().set_index(["axis", "run"])
    assert frame.loc[("x", "before"), "eM_m"] == pytest.approx(4e-5, rel=1e-3)
    assert frame.loc[("y", "after"), "eM_m"] == pytest.approx(1e-5, rel=1e-3)
    html = compared._repr_html_()
    assert "before / after" in html
    assert "4.00" in html
    with pytest.raises(motorctl.UsageError, match="at least one"):
        motorctl.compare()
