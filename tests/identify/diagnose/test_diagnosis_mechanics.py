"""Gears that rub, stops of rubber and loads on springs are named for what they are."""

from __future__ import annotations

import pytest
from fit_plant import C1
from hypothesis import given
from hypothesis import strategies as st
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.simulated_position import simulated_position
from motorctl.model import effect_class, make_effect


def named(plant, seed=3, duration_s=8.0):
    """Diagnose a run of a plant."""
    return diagnose_axis(plant.run(seed=seed, duration_s=duration_s), C1)


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.1, pytest.param(0.3, marks=pytest.mark.long)])
def test_friction_that_grows_with_the_motors_force_is_named_and_measured(loss):
    found = named(OtherPlant(loss=loss, width_m_s=4e-3))
    assert [effect.name for effect in found.effects] == ["load_friction"], found.sentence
    assert found.effects[0].theta[0] == pytest.approx(loss, rel=0.03)
    assert found.effects[0].effect.family() == "friction"


@pytest.mark.slow
def test_a_stop_of_rubber_is_no_friction_of_place():
    rubber = OtherPlant(stop_m=0.2, stop_stiffness=60.0, stop_damping_s_m=1.5, width_m_s=4e-3)
    found = named(rubber)
    assert [effect.name for effect in found.effects] == ["hard_stop"], found.sentence
    stop = found.effects[0]
    assert stop.effect.options.damped
    assert stop.effect.options.begin_m == pytest.approx(0.2, abs=1e-4)
    assert list(stop.theta) == pytest.approx([60.0, 90.0], rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("load_hz", "damping"), [(4.0, 0.05), (18.0, 0.3)])
def test_a_slow_or_a_well_damped_load_is_named(load_hz, damping):
    found = named(OtherPlant(load=0.4, load_hz=load_hz, load_damping=damping, bandwidth_hz=3.0))
    assert [effect.name for effect in found.effects] == ["flexible_mode"], found.sentence
    mode = found.effects[0].effect.options
    assert mode.frequency_hz == pytest.approx(load_hz, rel=0.03)
    assert mode.damping_ratio == pytest.approx(damping, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("load_hz", "damping", "coulomb"), [(9.0, 0.08, 0.25), (20.0, 0.04, 0.6)])
def test_a_load_with_friction_of_its_own_is_named_and_its_friction_measured(
    load_hz, damping, coulomb
):
    plant = OtherPlant(
        load=0.4, load_hz=load_hz, load_damping=damping, load_coulomb=coulomb, bandwidth_hz=3.0,
        shape="arctan", width_m_s=1.0 / 900.0,
    )  # fmt: skip
    found = named(plant)
    assert [effect.name for effect in found.effects] == ["flexible_mode"], found.sentence
    mode = found.effects[0]
    assert mode.effect.options.frequency_hz == pytest.approx(load_hz, rel=0.03)
    assert mode.effect.options.damping_ratio == pytest.approx(damping, rel=0.2)
    # per mass of the load, which is two fifths of the inertia
    braked = coulomb / (0.4 * plant.inertia)
    assert mode.effect.options.friction_m_s2 == pytest.approx(braked, rel=0.1)
    assert mode.theta[0] == pytest.approx(0.4 * plant.inertia, rel=0.05)


@pytest.mark.parametrize("side", ["acceleration", "command"])
def test_the_oscillation_of_a_load_is_in_the_position_that_its_model_predicts(side):
    plant = OtherPlant(
        load=0.4, load_hz=15.0, bandwidth_hz=5.0, shape="arctan", width_m_s=1.0 / 900.0
    )
    signals = make_signals(plant.run(seed=5, duration_s=8.0), slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    own = make_effect(effect_class("flexible_mode"), {"frequency_hz": 15.0, "damping_ratio": 0.05})
    mode = own if side == "command" else own.on_rigid_acceleration((0.4,))[0]
    rigid = Hypothesis(Regressors(signals, C1, blocks, side)).refreshed()
    flexible = Hypothesis(Regressors(signals, C1, blocks, side), (mode,)).refreshed()
    without, with_it = (simulated_position(each).by_window for each in (rigid, flexible))
    assert all(with_it[window] < 0.3 * without[window] for window in without)


@given(st.floats(1.0, 200.0), st.floats(0.0, 0.3), st.floats(0.0, 9.0), st.floats(-0.5, 0.8))
def test_a_mode_on_the_rigid_acceleration_is_the_mode_itself_once_more(
    hz, damping, friction, share
):
    mode = make_effect(
        effect_class("flexible_mode"),
        {"frequency_hz": hz, "damping_ratio": damping, "friction_m_s2": friction},
    )
    back, theta = mode.on_rigid_acceleration((share,))
    again, shares = back.on_own_acceleration(theta)
    assert shares[0] == pytest.approx(share, abs=1e-9)
    assert again.options.frequency_hz == pytest.approx(hz)
    assert again.options.damping_ratio == pytest.approx(damping, abs=1e-9)
    assert again.options.friction_m_s2 == pytest.approx(friction, abs=1e-9)
