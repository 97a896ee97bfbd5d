"""A real ball-screw axis (Janot, Gautier, Brunot 2019): what its published model lacks.

The recordings may not be republished, so they are looked for beside the project.
"""

from pathlib import Path

import numpy as np
import pytest
from fit_plant import C1

from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.log import read_recording

DATA = Path(__file__).parents[4] / "shared" / "data" / "emps"
TURN_M = 2.5e-3

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),  # two recordings of many effects, maybe on a busy machine
    pytest.mark.skipif(
        not DATA.is_dir(),
        reason="the EMPS recordings are not beside the project (../shared/data/emps)",
    ),
]


@pytest.fixture(scope="module")
def diagnosis(tmp_path_factory):
    folder = tmp_path_factory.mktemp("emps")
    recordings = []
    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        path = folder / f"{name}.yaml"
        path.write_text(
            f"file: {DATA / name}.mat\n"
            "sample_rate_hz: 1000\n"
            "axes:\n"
            "  x:\n"
            "    position: {column: qm, unit: m}\n"
            "    command: {column: vir, unit: V}\n"
            "    reference: {column: qg, unit: m}\n"
            "    force_per_command: {value: 35.15065188, unit: N/V}\n"
        )
        recordings.append(read_recording(path))
    train, pulses = recordings
    return diagnose_recording(train, {"x": C1}, evaluate_on=pulses).axes["x"]


def test_the_known_causes_are_named(diagnosis):
    found = {effect.name: effect for effect in diagnosis.effects}
    assert "asymmetric_friction" in found
    assert {"stribeck", "presliding"} & set(found)
    assert {"input_lag", "input_delay"} & set(found)


def test_the_ripple_has_the_pitch_of_the_screw(diagnosis):
    found = {effect.name: effect for effect in diagnosis.effects}
    periodic = found.get("cogging") or found["force_ripple"]
    assert periodic.effect.options.pitch_m == pytest.approx(TURN_M, rel=0.01)


def test_the_second_recording_is_predicted_better(diagnosis):
    error = diagnosis.error
    assert error.held_out_after_rms < error.held_out_before_rms
    assert error.held_out_after_rms <= 0.032 * error.command_rms


def test_the_fitted_recording_is_explained_to_under_two_hundredths(diagnosis):
    traces = diagnosis.traces
    left = np.linalg.norm(traces.residual_after) / np.linalg.norm(traces.command)
    assert left <= 0.02
