"""`motorctl fit` on files: models, JSON, text, refusals."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import typer
from fit_plant import X_THETA, simulate
from typer.testing import CliRunner

from motorctl.cli import fit
from motorctl.config import load
from motorctl.errors import DataError, UsageError

KEYS = {"value", "std_error", "unit"}


@pytest.fixture(scope="module")
def run():
    return simulate(seed=1, duration_s=6.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, run):
    """Hold one run as a log of the published gantry, and as foreign files."""
    folder = tmp_path_factory.mktemp("fit")
    columns = {"time_s": run.time_s, "x.position_m": run.position, "x.command_v": run.command}
    reference = {
        "x.reference_m": run.reference,
        "x.reference_velocity_m_s": run.reference_velocity,
        "x.reference_acceleration_m_s2": run.reference_acceleration,
    }
    document = {"rate_hz": run.rate_hz, "config": load("published_gantry").resolved}
    table = pa.table(columns | reference)
    pq.write_table(
        table.replace_schema_metadata({"motorctl": json.dumps(document)}), folder / "run.parquet"
    )
    pq.write_table(pa.table(columns), folder / "foreign.parquet")
    np.savetxt(
        folder / "rotary.csv",
        np.column_stack([run.time_s, np.degrees(run.position), 0.5 * run.command]),
        delimiter=",", header="t,angle,current", comments="",
    )  # fmt: skip
    (folder / "rotary.yaml").write_text(
        "file: rotary.csv\n"
        "time: {column: t, unit: s}\n"
        "axes:\n"
        "  spindle:\n"
        "    position: {column: angle, unit: deg}\n"
        "    command: {column: current, unit: A}\n"
        "    force_per_command: {value: 0.4, unit: N*m/A}\n"
        "segments: {fit: [0, 4], held_out: [4, 6]}\n"
    )
    return folder


@pytest.fixture
def invoke():
    app = typer.Typer()
    app.callback()(lambda: None)
    fit.register(app)

    def call(*arguments):
        return CliRunner().invoke(app, ["fit", *map(str, arguments)])

    return call


def document(result):
    assert result.exception is None, result.exception
    return json.loads(result.stdout)


def test_a_log_is_fitted_with_the_model_that_it_declares(invoke, folder):
    found = document(invoke(folder / "run.parquet", "--json"))
    assert found["sample_rate_hz"] == 5000.0
    assert found["duration_s"] == pytest.approx(6.0)
    axis = found["axes"]["x"]
    assert list(axis["parameters"]) == [
        "inertia", "viscous_friction", "coulomb_friction", "offset", "em_quadratic", "em_cubic",
    ]  # fmt: skip
    assert all(set(entry) == KEYS for entry in axis["parameters"].values())
    assert axis["parameters"]["inertia"]["value"] == pytest.approx(X_THETA[0], rel=1e-3)
    assert axis["parameters"]["inertia"]["unit"] == "V*s^2/m"
    assert axis["input_delay_s"]["value"] == pytest.approx(0.46 / 5000, abs=0.05 / 5000)
    assert set(axis["error"]) >= {
        "unit", "rms", "relative", "held_out_rms", "held_out_relative",
    }  # fmt: skip
    assert axis["error"]["unit"] == "V"
    assert axis["error"]["held_out_rms"] is None
    assert axis["instruments"]["agree"] is True
    assert axis["estimator"] == "instruments"
    assert axis["instruments"]["parameters"]["inertia"]["difference_percent"] < 0.1
    assert "parameters_force" not in axis


@pytest.fixture(scope="module")
def parts(folder):
    """Hold the same run as a daemon would that began a new log every two seconds."""
    table = pq.read_table(folder / "run.parquet")
    told = json.loads(table.schema.metadata[b"motorctl"])
    table = table.append_column("tick", pa.array(np.arange(len(table))))
    (folder / "logs").mkdir()
    paths = []
    for part, begin in enumerate(range(0, len(table), 10_000), 1):
        document = json.dumps(told | {"run": "gantry-1", "part": part})
        cut = table.slice(begin, 10_000).replace_schema_metadata({"motorctl": document})
        paths.append(folder / "logs" / f"gantry-{part}.parquet")
        pq.write_table(cut, paths[-1])
    return paths


@pytest.mark.slow
def test_the_logs_of_a_run_are_fitted_as_the_one_that_was_never_cut(invoke, folder, parts):
    uncut = document(invoke(folder / "run.parquet", "--json"))
    for given in (parts, [folder / "logs"], [parts[1], "--whole-run"], [folder / "logs/gantry-1"]):
        found = document(invoke(*given, "--json"))
        assert found["axes"] == uncut["axes"]
        assert found["duration_s"] == uncut["duration_s"]
    alone = document(invoke(parts[1], "--json"))
    assert alone["duration_s"] == pytest.approx(2.0)


def test_a_part_that_is_missing_is_a_hole_and_not_a_jump(invoke, folder, parts):
    uncut = document(invoke(folder / "run.parquet", "--json"))["axes"]["x"]["parameters"]
    found = document(invoke(parts[0], parts[2], "--json"))
    assert found["duration_s"] == pytest.approx(4.0)
    assert any("part 2 is missing" in note for note in found["notes"])
    inertia = found["axes"]["x"]["parameters"]["inertia"]["value"]
    assert inertia == pytest.approx(uncut["inertia"]["value"], rel=2e-3)


def test_c1_leaves_the_electromagnetic_effects_out(invoke, folder):
    axis = document(invoke(folder / "run.parquet", "--model", "C1", "--json"))["axes"]["x"]
    assert axis["model"] == ["inertia", "viscous_friction", "coulomb_friction", "offset"]


@pytest.mark.parametrize(("model", "count"), [(None, 4), ("C2", 6), ("published_gantry", 6)])
def test_a_foreign_recording_has_c1_unless_another_model_is_named(invoke, folder, model, count):
    arguments = ["--json"] if model is None else ["--model", model, "--json"]
    found = document(invoke(folder / "foreign.parquet", *arguments))
    assert len(found["axes"]["x"]["parameters"]) == count
    assert found["axes"]["x"]["instruments"] is None


def test_units_of_a_rotary_axis_with_a_current_command(invoke, folder):
    axis = document(invoke(folder / "rotary.yaml", "--model", "C2", "--json"))["axes"]["spindle"]
    inertia, quadratic = axis["parameters"]["inertia"], axis["parameters"]["em_quadratic"]
    assert (inertia["unit"], quadratic["unit"]) == ("A*s^2/rad", "1/A")
    assert inertia["value"] == pytest.approx(0.5 * X_THETA[0], rel=1e-3)
    force = axis["parameters_force"]
    assert force["inertia"]["unit"] == "N*m*s^2/rad"
    assert force["inertia"]["value"] == pytest.approx(0.4 * inertia["value"])
    assert force["em_quadratic"]["unit"] == "N*m/A^2"
    assert force["em_cubic"]["unit"] == "N*m/A^3"


def test_segments_of_the_description_give_the_held_out_error(invoke, folder):
    axis = document(invoke(folder / "rotary.yaml", "--model", "C2", "--json"))["axes"]["spindle"]
    assert axis["options"]["fit_segments"] == [[0.0, 4.0]]
    assert axis["error"]["unit"] == "A"
    assert 0.0 < axis["error"]["held_out_relative"] < 0.02


def test_a_second_recording_gives_the_held_out_error(invoke, folder):
    arguments = (folder / "run.parquet", "--evaluate", folder / "foreign.parquet", "--json")
    error = document(invoke(*arguments))["axes"]["x"]["error"]
    assert error["held_out_relative"] == pytest.approx(error["relative"], rel=1e-6)
    assert error["held_out_source"].endswith("foreign.parquet")


@pytest.mark.slow
def test_settings_reach_the_identification(invoke, folder, tmp_path):
    own = tmp_path / "mine.yaml"
    own.write_text("filter_hz: 100\nleft: command\nestimate_delay: false\n")
    told = document(invoke(folder / "run.parquet", "--settings", own, "--json"))["axes"]["x"]
    assert told["options"]["filter_hz"] == 100.0
    assert told["estimator"] == "least_squares"
    assert told["input_delay_s"]["value"] == 0.0
    shipped = invoke(folder / "run.parquet", "--settings", "janot2019", "--json")
    published = document(shipped)["axes"]["x"]
    assert published["options"]["coulomb_slope_s_m"] == "inf"
    assert published["options"]["discard_end"] == 0
    assert published["parameters"] != told["parameters"]


def test_the_default_settings_are_what_is_done_without_any(invoke, folder):
    plain = document(invoke(folder / "run.parquet", "--json"))
    assert document(invoke(folder / "run.parquet", "--settings", "default", "--json")) == plain


def test_the_table_tells_values_errors_and_the_choices_that_were_made(invoke, folder):
    result = invoke(folder / "rotary.yaml", "--model", "C2")
    assert result.exception is None
    for words in ("inertia", "em_cubic", "±", "held out:", "input delay:", "fitted on 0 to 4 s"):
        assert words in result.stdout
    assert max(map(len, result.stdout.splitlines()[:12])) <= 80


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (("--axis", "z"), UsageError, "no axis 'z'; it has: x"),
        (("--settings", "nothing"), UsageError, "nothing"),
        (("--evaluate", "missing.parquet"), DataError, "missing.parquet"),
    ],
)
def test_what_cannot_work_is_one_error(invoke, folder, arguments, error, words):
    result = invoke(folder / "run.parquet", *arguments)
    assert isinstance(result.exception, error)
    assert words in str(result.exception)
    assert result.stdout == ""


def test_a_filter_beyond_the_recording_is_one_error(invoke, folder, tmp_path):
    wide = tmp_path / "wide.yaml"
    wide.write_text("filter_hz: 4000\n")
    result = invoke(folder / "run.parquet", "--settings", wide)
    assert isinstance(result.exception, DataError)
    assert "2500 Hz" in str(result.exception)


def test_a_model_of_another_machine_with_several_axes_must_fit_by_name(invoke, folder):
    result = invoke(folder / "rotary.yaml", "--model", "published_gantry")
    assert isinstance(result.exception, UsageError)
    assert "spindle" in str(result.exception)
