"""A weight is told as one, where more freedom explains no more; so is a motor's cogging, slowly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from other_plant import OtherPlant
from scipy import signal

from motorctl.errors import DataError
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.measured_forms import Form
from motorctl.identify.diagnose.search.parameters import theta_of, values_of
from motorctl.identify.diagnose.search.simpler import simplest_first
from motorctl.identify.diagnose.verdict.recording_mistakes import check_explains
from motorctl.model import effect_class, make_effect

ARM = OtherPlant(
    inertia=0.05, gravity=6.0, travel=2.5, peak_velocity=1.5, bandwidth_hz=6.0, resolution=1e-5
)


def unexplained(rows, rms, seed=2):
    """Return a slow force that no effect has, of a given rms."""
    draw = np.random.default_rng(seed).standard_normal(rows)
    slow = signal.sosfiltfilt(signal.butter(2, 3.0, fs=5000.0, output="sos"), draw)
    return rms * slow / np.std(slow)


@pytest.fixture(scope="module")
def arm():
    run = ARM.run(seed=4, duration_s=16.0)
    command = run.command + unexplained(len(run.command), 0.15)
    return replace(run, command=command, position_unit="rad", command_unit="N*m")


@pytest.fixture(scope="module")
def weighed(arm):
    return diagnose_axis(arm, C1)


@pytest.mark.slow
def test_a_weight_beside_forces_without_a_name_is_no_spline(weighed):
    assert [effect.name for effect in weighed.effects] == ["gravity"]


@pytest.mark.slow
def test_a_model_that_could_move_nothing_is_no_yardstick(weighed):
    """Beside the weight the declared inertia comes out negative: it cannot be simulated."""
    assert weighed.declared_theta[0] < 0.0
    assert weighed.error.simulated_position_before_rms is None


def turning(cogging, seconds=30.0, rate_hz=500.0):
    """Return a bare motor at 0.03 turns a second that hardly feels anything but its cogging."""
    draw = np.random.default_rng(3)
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    turns = 0.03 * t + 2e-4 * np.sin(2.0 * np.pi * 0.21 * t)  # as far as its loop follows
    x = 2.0 * np.pi * np.round(turns * 8192.0) / 8192.0
    waves = sum(a * np.sin(k * 2.0 * np.pi * turns + k) for k, a in cogging.items())
    command = 0.1 + waves + 0.05 * draw.standard_normal(len(t))
    run = ARM.run(seed=1, duration_s=1.0)
    return replace(
        run, time_s=t, position=x, command=command, reference=None, sample_rate_hz=rate_hz,
        usable=np.ones(len(t), dtype=np.bool_), position_unit="rad", command_unit="A",
    )  # fmt: skip


def heard(data):
    return check_explains(data, make_signals(data), C1)


def test_a_motor_whose_command_is_all_cogging_is_heard():
    heard(turning({7: 0.5, 14: 0.3, 28: 0.4, 36: 0.2}))


def test_a_command_that_says_nothing_of_the_place_is_still_refused():
    with pytest.raises(DataError, match="explains none of the acceleration"):
        heard(turning({}))


def test_of_forms_that_take_the_same_the_one_with_least_freedom_leads(arm):
    signals = make_signals(arm, slope_s_m=900.0)
    spans = spans_of(signals)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    without = Hypothesis(Regressors(signals, C1, blocks, "command")).refreshed()
    weight = make_effect(effect_class("gravity"), {})
    knots = (*spans.position_m, 8)
    spline = make_effect(effect_class("position_force"), {"knots": knots})
    left = 0.05 * without.held_out

    def first(weight_leaves):
        forms = [Form(spline, left, left), Form(weight, weight_leaves, weight_leaves)]
        return simplest_first(without, forms, spans)[0].effect.name

    assert first(1.1 * left) == "gravity"
    assert first(2.0 * left) == "position_force"


@given(held=st.sets(st.sampled_from(["force", "micro_damping"]), max_size=2))
@settings(max_examples=4)
def test_what_is_held_at_zero_is_not_fitted(held):
    run = simulate(duration_s=4.0, theta=(0.2, 0.25, 0.14, 0.01, 0.0, 0.0))
    signals = make_signals(run.measured(), slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    effect = make_effect(effect_class("presliding"), {"displacement_m": 1e-4}).holding(held)
    fitted = values_of(Hypothesis(Regressors(signals, C1, blocks), (effect,)).refreshed())
    theta, error = theta_of(fitted, effect)
    names = [parameter.name for parameter in effect.parameters]
    assert {name for name, value in zip(names, theta, strict=True) if value == 0.0} == held
    assert all(error[names.index(name)] == 0.0 for name in held)
    assert effect.with_options(displacement_m=2e-4).held == effect.held
