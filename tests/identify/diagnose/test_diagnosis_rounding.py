"""Rounding of an encoder at a steady speed: a line within the band that is no machine's."""

from __future__ import annotations

from pathlib import Path

import pytest

import motorctl
from motorctl.identify.diagnose.result import AxisDiagnosis

STAGE = """
name: stage
rate_hz: 5000
drivers:
  sim:
    type: sim
    preset: published_gantry_clean
    seed: 1
    plants:
      0:
        inertia_v_s2_m: 0.4
        viscous_friction_v_s_m: 0.049
        coulomb_friction_v: 0.0392
        offset_v: 0
        em_quadratic_1_v: 0
        em_cubic_1_v2: 0
        force_noise_rms_v: 0.001
        {wave}
axes:
  x:
    driver: sim
    channel: 0
    encoder: {{resolution_m: 5.0e-7, counter_bits: 32}}
    limits:
      travel_m: [-0.05, 0.45]
      max_velocity_m_s: 0.8
      max_acceleration_m_s2: 12
      max_jerk_m_s3: 1200
      max_voltage_v: 10
      following_error: {{minimum_m: 0.001, per_velocity_s: 0.0004, filter_time_s: 0.002}}
      stop: {{acceleration_m_s2: 12, jerk_m_s3: 1200}}
    gains: {{k1_1_s: 245, ks_v_s_m: 196, gamma_d: 960, d_hat_max_v: 1}}
    model:
      inertia: {{initial: 0.4, bounds: [0.2, 0.8], covariance: 20}}
      viscous_friction: {{initial: 0.049, bounds: [0, 2.5], covariance: 176}}
      coulomb_friction: {{initial: 0.0392, bounds: [0, 1]}}
      offset: {{initial: 0, bounds: [-3, 3]}}
    adaptation: {{filter_rad_s: 200}}
    homing: {{method: absolute}}
    program: shuttle
programs:
  shuttle:
    kind: moves
    axis: x
    start_m: 0.05
    moves:
      - {{target_m: 0.41, max_velocity_m_s: 0.7, max_acceleration_m_s2: 10, max_jerk_m_s3: 1000}}
      - {{target_m: 0.1, max_velocity_m_s: 0.5, max_acceleration_m_s2: 8, max_jerk_m_s3: 800}}
      - {{target_m: 0.38, max_velocity_m_s: 0.35, max_acceleration_m_s2: 6, max_jerk_m_s3: 600}}
      - {{target_m: 0.05, max_velocity_m_s: {steady}, max_acceleration_m_s2: 8, max_jerk_m_s3: 800}}
    cycles: 2
"""
STEADY_M_S = 0.06743
"""26.972 counts a sample: the rounding repeats 140 times a second, within the band."""


def diagnosed(folder: Path, wave: str = "") -> AxisDiagnosis:
    """Simulate a stage that lacks nothing, or a wave along its way, and diagnose it."""
    config = folder / "stage.yaml"
    config.write_text(STAGE.format(steady=STEADY_M_S, wave=wave))
    motorctl.simulate(config, folder / "run.parquet")
    return motorctl.diagnose(folder / "run.parquet").axes["x"]


@pytest.mark.slow
def test_a_line_of_rounding_is_no_structure_of_the_machine(tmp_path: Path) -> None:
    found = diagnosed(tmp_path)
    assert found.verdict == "complete", found.sentence
    assert any("put down to the measurement" in note for note in found.notes)


@pytest.mark.slow
def test_a_weak_wave_beside_the_line_is_still_named(tmp_path: Path) -> None:
    found = diagnosed(
        tmp_path, "cogging: {pitch_m: 0.025, harmonics: [{order: 1, amplitude_v: 0.01}]}"
    )
    assert [effect.name for effect in found.effects] == ["cogging"], found.sentence
