"""Recordings of other makes: units, formats, rates, encoders, one axis or many."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from fit_plant import COGGING_PITCH_M, X_THETA, simulate

from motorctl.identify.columns.measured import measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.report.json_document import diagnosis_document
from motorctl.identify.diagnose.search.undetermined import without_undetermined
from motorctl.identify.fit.declared_models import declared_models
from motorctl.log import read_recording

LINEAR = X_THETA[:4]
AMPLITUDE_V = 0.3
AMPERE_PER_VOLT = 2.0
NEWTON_PER_VOLT = 40.0
RAD_PER_M = 50.0


def plant(rate_hz, resolution=0.5e-6, seed=4, duration_s=10.0):
    slow = min(1.0, rate_hz / 1000.0)
    return simulate(
        seed=seed,
        duration_s=duration_s,
        rate_hz=rate_hz,
        resolution=resolution,
        delay_samples=0.0,
        theta=LINEAR,
        cogging=AMPLITUDE_V,
        peak_velocity=0.6 * slow + 0.1,
        peak_acceleration=15.0 * slow + 1.0,
    )


@pytest.fixture(scope="module")
def run():
    return plant(1000.0)


def write(folder, kind, columns, axes, rate_hz):
    path = folder / f"measured.{kind}"
    if kind == "csv":
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    elif kind == "parquet":
        pq.write_table(pa.table(columns), path)
    else:
        scipy.io.savemat(path, columns)
    text = f"file: {path.name}\nsample_rate_hz: {rate_hz:g}\naxes:\n"
    for axis, lines in axes.items():
        text += f"  {axis}:\n" + "".join(f"    {line}\n" for line in lines)
    description = folder / "measured.yaml"
    description.write_text(text)
    return description


def diagnosed(path, model=None):
    recording = read_recording(path, gaps="keep")
    found = diagnose_recording(recording, declared_models(recording, model))
    return diagnosis_document(found)


def the_cogging(document, axis="x"):
    told = document["axes"][axis]
    assert told["verdict"] == "effect", told["sentence"]
    assert told["effects"][0]["name"] == "cogging"
    return told["effects"][0]


@pytest.mark.slow
def test_csv_in_millimetres_with_a_reference(tmp_path, run):
    columns = {"q": 1e3 * run.position, "u": run.command, "r": 1e3 * run.reference}
    axes = {
        "x": [
            "position: {column: q, unit: mm}",
            "command: {column: u, unit: V}",
            "reference: {column: r, unit: mm}",
        ]
    }
    document = diagnosed(write(tmp_path, "csv", columns, axes, 1000.0))
    found = the_cogging(document)
    pitch = found["parameters"]["pitch_m"]
    assert pitch["unit"] == "m"
    assert pitch["value"] == pytest.approx(COGGING_PITCH_M, rel=0.002)
    inertia = document["axes"]["x"]["parameters"]["inertia"]
    assert inertia["unit"] == "V*s^2/m"
    assert inertia["value"] == pytest.approx(LINEAR[0], rel=0.02)


@pytest.mark.slow
def test_mat_of_a_rotary_axis_in_degrees_and_amperes(tmp_path, run):
    columns = {
        "angle": np.degrees(RAD_PER_M * run.position)[:, None],
        "i": AMPERE_PER_VOLT * run.command[:, None],
    }
    axes = {
        "spindle": [
            "position: {column: angle, unit: deg}",
            "command: {column: i, unit: A}",
            "force_per_command: {value: 0.1, unit: N*m/A}",
        ]
    }
    document = diagnosed(write(tmp_path, "mat", columns, axes, 1000.0))
    found = the_cogging(document, "spindle")
    pitch = next(v for k, v in found["parameters"].items() if k.startswith("pitch"))
    assert pitch["unit"] == "rad"
    assert pitch["value"] == pytest.approx(RAD_PER_M * COGGING_PITCH_M, rel=0.002)
    told = document["axes"]["spindle"]
    inertia = told["parameters"]["inertia"]
    assert inertia["unit"] == "A*s^2/rad"
    assert inertia["value"] == pytest.approx(LINEAR[0] * AMPERE_PER_VOLT / RAD_PER_M, rel=0.02)
    assert told["error"]["unit"] == "A"
    torque = told["parameters_force"]["inertia"]
    assert torque["unit"] == "N*m*s^2/rad"
    assert torque["value"] == pytest.approx(0.1 * inertia["value"])


@pytest.mark.slow
def test_electromagnetic_effects_are_dropped_with_a_word_where_the_command_is_no_voltage(
    tmp_path, run
):
    columns = {"q": run.position, "f": NEWTON_PER_VOLT * run.command}
    axes = {"x": ["position: {column: q, unit: m}", "command: {column: f, unit: N}"]}
    document = diagnosed(write(tmp_path, "parquet", columns, axes, 1000.0), "C2")
    told = document["axes"]["x"]
    assert set(told["dropped"]) == {"em_quadratic", "em_cubic"}
    assert "not the voltage that saturates" in told["dropped"]["em_cubic"]
    assert told["declared"] == ["inertia", "viscous_friction", "coulomb_friction", "offset"]
    inertia = told["parameters"]["inertia"]
    assert inertia["unit"] == "N*s^2/m"
    assert inertia["value"] == pytest.approx(NEWTON_PER_VOLT * LINEAR[0], rel=0.02)
    the_cogging(document)


def test_electromagnetic_effects_are_dropped_where_commands_are_too_small(tmp_path):
    run = simulate(
        seed=4,
        duration_s=8.0,
        rate_hz=1000.0,
        delay_samples=0.0,
        theta=LINEAR,
        peak_velocity=0.3,
        peak_acceleration=1.0,
        force_noise=0.15,
    )
    columns = {"q": run.position, "u": run.command}
    axes = {"x": ["position: {column: q, unit: m}", "command: {column: u, unit: V}"]}
    recording = read_recording(write(tmp_path, "parquet", columns, axes, 1000.0), gaps="keep")
    declared = declared_models(recording, "C2")["x"]
    _, dropped = without_undetermined(make_signals(measured(recording, "x")), declared)
    assert set(dropped) == {"em_quadratic", "em_cubic"}
    assert "do not determine the bend" in dropped["em_quadratic"]


@pytest.mark.slow
def test_many_axes_of_which_one_stands(tmp_path, run):
    other = plant(1000.0, seed=9)
    columns = {
        "q1": run.position,
        "u1": run.command,
        "q2": 2e5 * other.position,
        "u2": other.command,
        "q3": np.zeros_like(run.position),
        "u3": np.zeros_like(run.position),
    }
    axes = {
        "x": ["position: {column: q1, unit: m}", "command: {column: u1, unit: V}"],
        "y": [
            "position: {column: q2, unit: count, resolution: 0.5e-5}",
            "command: {column: u2, unit: V}",
        ],
        "z": ["position: {column: q3, unit: m}", "command: {column: u3, unit: V}"],
    }
    document = diagnosed(write(tmp_path, "parquet", columns, axes, 1000.0))
    the_cogging(document, "x")
    the_cogging(document, "y")
    assert "z" not in document["axes"]
    assert "no motion" in document["refused"]["z"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate_hz", "resolution"),
    [
        (100.0, 1e-6),
        (20000.0, 0.1e-6),
        pytest.param(500.0, 10e-6, marks=pytest.mark.long),
        pytest.param(5000.0, 5e-6, marks=pytest.mark.long),
    ],
)
def test_any_rate_and_encoder(tmp_path, rate_hz, resolution):
    run = plant(rate_hz, resolution)
    columns = {"q": run.position, "u": run.command}
    axes = {"x": ["position: {column: q, unit: m}", "command: {column: u, unit: V}"]}
    document = diagnosed(write(tmp_path, "parquet", columns, axes, rate_hz))
    pitch = the_cogging(document)["parameters"]["pitch_m"]
    assert pitch["value"] == pytest.approx(COGGING_PITCH_M, rel=0.01)
