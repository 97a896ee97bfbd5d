"""The page's simulated axis runs as it stands there, and shows the force that nobody declared."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.config import load
from motorctl.identify.fit.recording import fit_recording
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
TOLD = (
    "--driver", "brake_stage:BrakeStage", "--axis", "x", "--encoder", "0.5um", "--mass", "12kg",
    "--force-constant", "30N/V", "--travel=-0.05..0.3", "--max-velocity", "0.6m/s",
)  # fmt: skip


def test_init_simulate_and_fit_find_the_brake_that_its_plant_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in (DOCS, DOCS / "drivers"):
        monkeypatch.syspath_prepend(str(folder))
    path = tmp_path / "stage.yaml"
    result = CliRunner().invoke(make_app(), ["init", str(path), *TOLD])
    assert result.exit_code == 0, result.output
    assert "motorctl simulate" in result.stdout
    document = yaml.safe_load(path.read_text())
    assert document["drivers"] == {"brake_stage": {"type": "brake_stage:BrakeStage"}}
    log = tmp_path / "run.parquet"
    simulate(load(path), log, duration_s=3.0)
    own = {"type": "eddy_brake:EddyBrake", "peak_velocity_m_s": 0.2, "bounds": [0, 5]}
    document["axes"]["x"]["model"]["eddy_brake"] = own
    declared = tmp_path / "declared.yaml"
    declared.write_text(yaml.safe_dump(document, sort_keys=False))
    models = {"x": load(declared).axes["x"].declared}
    fit = fit_recording(read_recording(log), models).axes["x"]
    found = dict(zip(fit.model.parameter_names, fit.theta, strict=True))
    assert found["eddy_brake"] == pytest.approx(2.0, rel=0.03)
    assert found["inertia"] == pytest.approx(0.4, rel=0.01)
    assert found["viscous_friction"] == pytest.approx(0.3, rel=0.1)
