"""One file teaches motorctl a new effect: configuration, loop, log and fit then know it."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from loop_bench import rich_points
from seventh_effect import SeventhEffect

from motorctl.config import load
from motorctl.identify.fit.recording import fit_recording
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl.model import catalog, effects

SHIPPED = Path(__file__).parents[2] / "configs" / "published_gantry.yaml"
DURATION_S = 12.0
PITCH_M, RIPPLE_V, PHASE = 0.06, 0.35, 0.7
STIFFNESS_V_M = 0.8
TRUTH = {
    "inertia": 0.197,
    "viscous_friction": 0.2265,
    "coulomb_friction": 0.139,
    "offset": 0.012,
    # what pushes the carriage is what the command does not have to
    "seventh_effect_sin": -RIPPLE_V * math.cos(PHASE),
    "seventh_effect_cos": -RIPPLE_V * math.sin(PHASE),
    "tilted_way": STIFFNESS_V_M,
    "own_saturation_quadratic": -0.0122,
    "own_saturation_skew": 0.0,
}


@pytest.fixture(scope="module")
def known_by_its_file():
    """Let the folder of effects hold one more file."""
    folder = str(Path(__file__).parent / "dropped_effects")
    effects.__path__.append(folder)
    catalog.built_in_entries.cache_clear()
    catalog.built_in_effects.cache_clear()
    catalog.known_effects.cache_clear()
    yield
    effects.__path__.remove(folder)
    catalog.built_in_entries.cache_clear()
    catalog.built_in_effects.cache_clear()
    catalog.known_effects.cache_clear()
    sys.modules.pop("motorctl.model.effects.tilted_way", None)


@pytest.fixture(scope="module")
def recorded(known_by_its_file, tmp_path_factory):
    """Return the machine of a YAML file with three more effects, and the log of a run of it."""
    folder = tmp_path_factory.mktemp("machine")
    data = yaml.safe_load(SHIPPED.read_text())
    del data["axes"]["y"]
    axis = data["axes"]["x"]
    axis["encoder"] |= {"resolution_m": 1e-9, "counter_bits": 64}
    axis["limits"] |= {"max_velocity_m_s": 2.0, "max_jerk_m_s3": 20000}
    axis["program"] = "rich"
    axis["adaptation"] |= {"normalisation": 0.0, "forgetting_1_s": 1.0, "covariance_limit": 1e4}
    own = {"sin": {"bounds": [-1.0, 1.0]}, "cos": {"initial": 0.1}}
    del axis["model"]["em_quadratic"], axis["model"]["em_cubic"]
    axis["model"] |= {
        "seventh_effect": {
            "type": "seventh_effect:SeventhEffect", "pitch_m": PITCH_M, "parameters": own,
        },
        "tilted_way": {"initial": 0.0, "covariance": 1e4},
        "own_saturation": {"type": "own_saturation:OwnSaturation"},
    }  # fmt: skip
    rich_points(folder / "rich.csv", DURATION_S, x=30.0)
    data["programs"] = {"rich": {"kind": "points", "axes": ["x"], "file": "rich.csv"}}
    harmonic = {"order": 1, "amplitude_v": RIPPLE_V, "phase_rad": PHASE}
    plant = {
        "em_cubic_1_v2": 0.0,
        "cogging": {"pitch_m": PITCH_M, "harmonics": [harmonic]},
        "position_force": {"spring_v_m": STIFFNESS_V_M},
    }
    preset = {"type": "sim", "preset": "published_gantry_clean", "plants": {0: plant}}
    data["drivers"] = {"gantry": preset}
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    machine = load(path)
    log = simulate(machine, folder / "run.parquet").log
    return machine, read_recording(log)


def test_a_file_in_the_folder_of_effects_is_found_by_its_name(known_by_its_file):
    assert "tilted_way" in catalog.known_effects()
    assert catalog.effect_class("tilted_way").title == "Force that grows along the way"


@pytest.mark.slow
def test_the_configuration_knows_the_effects_names_options_and_bounds(recorded):
    machine, _ = recorded
    axis = machine.axes["x"]
    assert axis.model.parameter_names == tuple(TRUTH)
    by_name = dict(zip(axis.model.parameter_names, axis.estimates, strict=True))
    assert (by_name["seventh_effect_sin"].lower, by_name["seventh_effect_sin"].upper) == (-1, 1)
    assert by_name["seventh_effect_cos"].initial == 0.1
    (seventh,) = (e for e in axis.model.effects if isinstance(e, SeventhEffect))
    assert seventh.constants == (2 * math.pi / PITCH_M,)
    written = machine.resolved["axes"]["x"]["model"]["seventh_effect"]
    assert written["pitch_m"] == PITCH_M
    assert written["parameters"]["sin"]["bounds"] == [-1.0, 1.0]


@pytest.mark.slow
def test_the_log_has_a_column_for_each_of_their_parameters(recorded):
    _, recording = recorded
    assert list(recording.axes["x"].theta_hat) == list(TRUTH)


@pytest.mark.slow
def test_the_loop_learns_their_parameters(recorded):
    _, recording = recorded
    theta_hat = {name: float(v[-1]) for name, v in recording.axes["x"].theta_hat.items()}
    for name, truth in TRUTH.items():
        assert theta_hat[name] == pytest.approx(truth, rel=0.05, abs=2e-3), name
    first = {name: float(v[0]) for name, v in recording.axes["x"].theta_hat.items()}
    assert first["seventh_effect_sin"] == 0.0


@pytest.mark.slow
def test_the_loop_compensates_what_it_learned(recorded):
    _, recording = recorded
    axis = recording.axes["x"]
    error = axis.position - axis.reference
    # The ripple alone moves an axis by A/(ks k1) where it is not compensated.
    late = error[int(0.6 * len(error)) : int(0.9 * len(error))]
    assert np.sqrt(np.mean(late**2)) < 0.7 * RIPPLE_V / math.sqrt(2) / (95.0 * 250.0)


@pytest.mark.slow
def test_fit_identifies_their_parameters_from_the_log(recorded):
    machine, recording = recorded
    fit = fit_recording(recording, {"x": machine.axes["x"].model}).axes["x"]
    for name, truth in TRUTH.items():
        assert fit.value(name) == pytest.approx(truth, rel=0.05, abs=2e-3), name
