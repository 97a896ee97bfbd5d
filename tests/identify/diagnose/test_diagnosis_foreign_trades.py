"""Machines of other trades: a name that would be sure and wrong is not given, or has its rival."""

from math import sin

import pytest
from fit_plant import C1
from foreign_axes import cylinder, rotor, small_turn, worm_joint

from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.report.json_document import axis_document

pytestmark = pytest.mark.slow

SURE = 0.5


def sure(found):
    return {effect.name: effect for effect in found.effects if effect.confidence >= SURE}


def test_friction_that_grows_with_a_joints_load_is_not_called_one_of_place():
    """With the command on the left it cannot be tried, and a friction of place comes nearest."""
    found = diagnose_axis(worm_joint(loss=0.1), C1)
    assert set(sure(found)) == {"gravity"}, found.sentence
    assert any("the recording may show load_friction" in note for note in found.notes)


def test_over_a_small_turn_a_weight_may_be_a_hose():
    found = diagnose_axis(small_turn(lambda x: 4.0 * sin(x - 0.5), turn_rad=0.15), C1)
    (told,) = axis_document(found)["effects"]
    assert told["family"] == "force_of_position"
    assert told["confidence"] < SURE
    assert {"gravity", "position_force"} == {told["name"], *told["indistinguishable_from"]}


@pytest.mark.long
def test_a_hose_over_a_small_turn_is_no_weight():
    found = diagnose_axis(small_turn(lambda x: 1.2 * x + 0.5 * x * x, turn_rad=0.5), C1)
    assert "gravity" not in sure(found)
    assert any(effect.effect.family() == "force_of_position" for effect in found.effects)


@pytest.mark.long
def test_over_a_large_turn_a_weight_is_a_weight():
    found = diagnose_axis(small_turn(lambda x: 4.0 * sin(x - 0.5), turn_rad=1.5), C1)
    assert sure(found)["gravity"].indistinguishable_from == ()


def test_a_lag_that_needs_a_negative_inertia_is_not_named():
    """A velocity lags behind a force by inertia over friction; one below zero would need a lag."""
    found = diagnose_axis(cylinder(), C1)
    assert not any(effect.effect.family() == "command_timing" for effect in found.effects)


def test_a_bend_of_a_command_that_is_no_motors_says_what_else_bends():
    found = diagnose_axis(rotor(), C1)
    assert any("a propeller, a pump or a valve" in note for note in found.notes), found.sentence
