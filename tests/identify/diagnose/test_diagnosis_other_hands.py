"""Machines of another author: friction of other shapes, joints under gravity, wrong columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import SHAPES, OtherPlant
from tiers import few_of

from motorctl.errors import DataError
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.report.json_document import axis_document
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.physics import beyond_physics
from motorctl.identify.diagnose.search.search import whitened
from motorctl.model import EffectList, effect_class, make_effect
from motorctl.model.sign_function import SHAPES as KNOWN_SHAPES

SLOW = pytest.mark.slow
LASTS_S = 8.0
"""Of a recording: enough moves to tell all that is asked here."""
FRICTIONS = [
    *((shape, 5e-3) for shape in SHAPES),
    *((shape, 1e-3) for shape in ("tanh", "arctan", "clip")),
]


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "width"), few_of(FRICTIONS, 2))
def test_friction_of_another_shape_than_declared_is_mended_and_nothing_is_added(shape, width):
    data = OtherPlant(shape=shape, width_m_s=width).run(SHAPES.index(shape), LASTS_S)
    found = diagnose_axis(data, C1)
    assert (found.verdict, found.effects) == ("complete", ()), found.sentence
    (mended,) = axis_document(found)["mended"]
    assert mended["name"] == "coulomb_friction"
    assert mended["declared"]["slope_s_m"] == 900.0
    assert mended["options"]["slope_s_m"] == pytest.approx(1.0 / width, rel=0.25)
    assert mended["options"].get("sign_shape", "arctan") == shape
    assert found.theta[:3] == pytest.approx((0.25, 0.3, 0.2), rel=0.02)
    assert any("coulomb_friction has slope_s_m" in note for note in found.notes)


@SLOW
def test_declaring_what_was_named_leaves_nothing_to_name():
    wave = make_effect(effect_class("cogging"), {"pitch_m": 0.06, "orders": (1, 2)})
    plant = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0, cogging=0.05)
    found = diagnose_axis(plant.run(4, LASTS_S), EffectList((*C1.effects, wave)))
    assert (found.verdict, found.effects) == ("complete", ())
    assert len(found.declared_theta) == len(C1) + 4


@SLOW
def test_declaring_what_was_mended_leaves_nothing_to_mend():
    data = OtherPlant(width_m_s=5e-3).run(1, LASTS_S)
    found = diagnose_axis(data, C1)
    again = diagnose_axis(data, found.declared)
    assert (again.verdict, again.mended) == ("complete", ())
    assert np.allclose(again.theta, found.theta, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_a_friction_as_it_is_declared_is_not_touched():
    found = diagnose_axis(OtherPlant(shape="arctan", width_m_s=1.0 / 900.0).run(3, LASTS_S), C1)
    assert (found.verdict, found.mended) == ("complete", ())


def test_every_shape_of_friction_that_machines_have_here_is_known():
    assert set(SHAPES) == set(KNOWN_SHAPES)


JOINT = OtherPlant(
    inertia=0.005, viscous=0.3, coulomb=0.6, shape="arctan", width_m_s=2e-3, command_noise=0.02,
    peak_velocity=1.0, peak_acceleration=4.0, travel=1.5, bandwidth_hz=6.0, resolution=1e-5,
)  # fmt: skip


@SLOW
def test_a_joint_that_is_nearly_all_friction_is_a_joint_and_no_mistake():
    found = diagnose_axis(JOINT.run(5, LASTS_S), C1)
    assert found.theta[2] == pytest.approx(0.6, rel=0.1)


@SLOW
def test_gravity_that_outweighs_inertia_is_no_reversed_sign():
    hanging = replace(JOINT, gravity=-4.0, coulomb=0.1)
    found = diagnose_axis(hanging.run(6, LASTS_S), C1)
    assert found.verdict in ("effect", "unknown_structure")
    assert all("position" in effect.name for effect in found.effects)


@pytest.mark.parametrize("gravity", [0.0, -4.0])
def test_a_reversed_sign_is_told_with_gravity_and_without(gravity):
    data = replace(JOINT, gravity=gravity).run(7, LASTS_S)
    with pytest.raises(DataError, match="the sign of one of the two is reversed"):
        diagnose_axis(replace(data, command=-data.command), C1)


def test_a_weight_that_is_refuted_beside_a_reversed_sign_says_so():
    plant = replace(JOINT, inertia=0.1, gravity=2.0)
    data = replace(plant.run(seed=6, duration_s=12.0), position_unit="rad")
    sine = make_effect(effect_class("gravity"), None)

    def refuted(command):
        signals = make_signals(replace(data, command=command), slope_s_m=900.0)
        regressors, _ = whitened(signals, C1, (sine,), "command")
        return beyond_physics(Hypothesis(regressors, (sine,)).refreshed())

    assert refuted(data.command) is None
    impossible = refuted(-data.command)
    assert impossible is not None
    assert "may be reversed in the recording" in impossible[1]


@pytest.mark.slow
def test_another_axis_command_is_told():
    plant = OtherPlant()
    data, other = plant.run(8, LASTS_S), plant.run(9, LASTS_S)
    with pytest.raises(DataError, match="of the same axis, in time with each other"):
        diagnose_axis(replace(data, command=other.command), C1)
