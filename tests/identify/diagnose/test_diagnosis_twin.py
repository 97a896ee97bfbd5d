"""Beside its clean twin: coarse encoders and coloured noise are no structure of the machine."""

from __future__ import annotations

import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.diagnose.recording import diagnose_axis


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["tanh", pytest.param("clip", marks=pytest.mark.long)])
@pytest.mark.parametrize("resolution", [5e-6, pytest.param(5e-5, marks=pytest.mark.long)])
def test_a_coarse_encoder_is_no_missing_effect(shape, resolution):
    plant = OtherPlant(shape=shape, width_m_s=5e-3, resolution=resolution, bandwidth_hz=8.0)
    axis = diagnose_axis(plant.run(seed=5, duration_s=10.0), C1)
    assert axis.effects == ()
    assert axis.verdict in ("complete", "insufficient_data")


@pytest.mark.slow
def test_cogging_behind_a_coarse_encoder_is_still_found():
    plant = OtherPlant(resolution=5e-5, bandwidth_hz=8.0, cogging=0.15, pitch_m=0.03)
    axis = diagnose_axis(plant.run(seed=6, duration_s=10.0), C1)
    assert [effect.name for effect in axis.effects][:1] == ["cogging"]


@pytest.mark.slow
def test_the_weight_of_an_arm_is_named_with_its_family():
    plant = OtherPlant(inertia=0.05, gravity=2.0, travel=2.5, peak_velocity=1.5, resolution=1e-5)
    data = plant.run(seed=2, duration_s=10.0)
    data = type(data)(**{**data.__dict__, "position_unit": "rad", "command_unit": "A"})
    (effect,) = diagnose_axis(data, C1).effects
    assert effect.name == "gravity"
    assert effect.effect.family() == "force_of_position"
    assert effect.family_confidence >= effect.confidence > 0.6
    assert (effect.theta**2).sum() ** 0.5 == pytest.approx(2.0, rel=0.02)
