"""The published identification of a real axis (Janot, Gautier, Brunot 2019), digit for digit.

The recordings may not be republished, so they are looked for beside the project.
"""

from pathlib import Path

import pytest
from fit_plant import C1

from motorctl.identify.fit.recording import RecordingFit, fit_recording
from motorctl.identify.fit.report import force_values
from motorctl.identify.fit.settings import FitOptions, load_settings
from motorctl.log import read_recording

DATA = Path(__file__).parents[4] / "shared" / "data" / "emps"

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="the EMPS recordings are not beside the project (../shared/data/emps)"
)


def describe(folder: Path, name: str) -> Path:
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
    return path


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("emps")
    return [read_recording(describe(folder, n)) for n in ("DATA_EMPS", "DATA_EMPS_PULSES")]


def identify(recordings, options: FitOptions) -> RecordingFit:
    train, pulses = recordings
    return fit_recording(train, {"x": C1}, options, pulses).axes["x"]


def test_the_published_settings_give_the_published_digits(recordings):
    fit = identify(recordings, load_settings("janot2019"))
    forces = {name: entry["value"] for name, entry in force_values(fit).items()}
    assert forces == {
        "inertia": pytest.approx(95.1089, abs=5e-5),
        "viscous_friction": pytest.approx(203.5034, abs=5e-5),
        "coulomb_friction": pytest.approx(20.3935, abs=5.1e-5),
        "offset": pytest.approx(-3.1648, abs=5e-5),
    }
    assert 100 * fit.error.relative == pytest.approx(4.0834, abs=5e-5)
    assert 100 * fit.held_out.relative == pytest.approx(5.9824, abs=5e-5)


def test_an_offset_in_newtons_stands_on_the_loads_side(recordings):
    fit = identify(recordings, load_settings("janot2019"))
    offset = force_values(fit)["offset"]
    assert offset["side"] == "load"
    assert offset["value"] == pytest.approx(-35.15065188 * fit.value("offset"))


def test_the_default_settings_predict_the_second_recording_better(recordings):
    published = identify(recordings, load_settings("janot2019"))
    fit = identify(recordings, FitOptions())
    assert fit.held_out.relative < 0.75 * published.held_out.relative
    assert abs(fit.delay_s) < 1e-3
    assert not fit.disagreement().any()
