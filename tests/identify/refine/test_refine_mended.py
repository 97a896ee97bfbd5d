"""A friction that was declared of a wrong shape, from the log to a configuration that has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorctl.config import load
from motorctl.config.shipped import shipped_config
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.refine.refinement import refine_config
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate

SLOPE_S_M = 150.0
SHIPPED = "gantry: {type: sim, preset: published_gantry, seed: 1}"
SOFT = (
    "gantry: {type: sim, preset: published_gantry_clean, seed: 1, "
    f"plants: {{0: {{friction_slope_s_m: {SLOPE_S_M}}}}}}}"
)


def diagnosed(config: Path, folder: Path):
    log = folder / f"{config.stem}.parquet"
    simulate(load(config), log, duration_s=16.0)
    recording = read_recording(log)
    models = declared_models(recording, None, "x")
    return diagnose_recording(recording, models)


@pytest.mark.long
@pytest.mark.slow
def test_a_mended_friction_is_written_and_needs_no_mending_afterwards(tmp_path: Path) -> None:
    text = shipped_config("published_gantry").read_text()
    assert SHIPPED in text
    before = tmp_path / "before.yaml"
    before.write_text(text.replace(SHIPPED, SOFT))
    found = diagnosed(before, tmp_path)
    assert found.axes["x"].effects == ()
    (mended,) = found.axes["x"].mended
    assert mended.options["slope_s_m"] == pytest.approx(SLOPE_S_M, rel=0.03)
    after = tmp_path / "after.yaml"
    refined = refine_config(found, before, after)
    after.write_text(refined.text)
    assert refined.axes["x"].added == ()
    assert any(mended.sentence in done for done in refined.axes["x"].done)
    (friction,) = (e for e in load(after).axes["x"].declared.effects if e.name == mended.name)
    assert friction.options.slope_s_m == pytest.approx(SLOPE_S_M, rel=0.03)
    assert diagnosed(after, tmp_path).axes["x"].mended == ()
