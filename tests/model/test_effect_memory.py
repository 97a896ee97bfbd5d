"""Effects that remember do what their differential equations say, at any sample rate."""

import math
from itertools import pairwise

import numpy as np
import pytest
from effect_forms import form
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lsim

from motorctl.model import EffectList
from motorctl.model.columns import state_columns

XS = 1e-5


def presliding(x, v=None, vs=None, displacement_m=XS):
    """Return h and the bristles' rate along positions, one tick apart."""
    still = np.zeros_like(x)
    t = np.arange(len(x)) * 2e-4
    effect = form("presliding", displacement_m=displacement_m)
    v, vs = (still if signal is None else signal for signal in (v, vs))
    return state_columns(effect, x, v, still, vs, t)


def flexible(a, period_s, frequency_hz=80.0, damping_ratio=0.02):
    """Return G a along accelerations."""
    still = np.zeros_like(a)
    t = np.arange(len(a)) * period_s
    effect = form("flexible_mode", frequency_hz=frequency_hz, damping_ratio=damping_ratio)
    return -state_columns(effect, still, still, a, still, t)[0]


def test_a_first_motion_loads_the_bristles_as_dahl_says():
    x = 0.3 + np.linspace(0.0, 50e-6, 11)
    h, _ = presliding(x)
    assert np.allclose(h, 1.0 - np.exp(-(x - x[0]) / XS), atol=1e-9)


def test_a_reversal_follows_dahls_loop():
    there = np.linspace(0.0, 200e-6, 40)
    back = np.linspace(195e-6, 100e-6, 30)
    h, _ = presliding(np.concatenate([there, back]))
    turned = 1.0 - np.exp(-200e-6 / XS)
    assert np.allclose(h[40:], -1.0 + (turned + 1.0) * np.exp(-(200e-6 - back) / XS), atol=1e-9)


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.integers(1, 40), st.floats(1e-7, 1e-3))
def test_presliding_depends_on_the_path_and_not_on_its_sampling(seed, finer, displacement_m):
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.normal(size=12) * 30e-6)
    legs = [np.linspace(a, b, finer, endpoint=False) for a, b in pairwise(turns)]
    path = np.concatenate(legs)
    h, _ = presliding(np.append(path, turns[-1]), displacement_m=displacement_m)
    coarse, _ = presliding(turns, displacement_m=displacement_m)
    assert np.allclose(h[::finer], coarse, atol=1e-8)
    assert (abs(h) <= 1.0).all()


def test_bristles_that_stand_still_keep_their_force():
    x = np.concatenate([np.linspace(0.0, 1e-5, 5), np.full(1000, 1e-5)])
    h, _ = presliding(x)
    assert (h[5:] == h[4]).all()


def test_where_a_recording_begins_is_no_motion():
    h, _ = presliding(np.full(5, 0.37))
    assert (h == 0.0).all()


def test_sliding_bristles_have_coulombs_force_and_no_rate():
    x = np.linspace(0.0, 0.1, 1000)
    v = np.full_like(x, 0.5)
    force, rate = presliding(x, v, v)
    assert np.allclose(force[9:], 1.0 - 2.0 / math.pi * math.atan(450.0), atol=1e-12)
    assert np.allclose(rate[9:], 0.0, atol=1e-12)
    assert rate[0] == 0.5


def test_the_bristles_rate_is_the_derivative_of_their_state():
    t = np.arange(4000) * 2e-4
    x, v = 40e-6 * np.sin(3.0 * t), 120e-6 * np.cos(3.0 * t)
    h, rate = presliding(x, v)
    slope = np.gradient(h, t) * XS
    # a kink stands at every reversal
    smooth = abs(v) > 10e-6
    assert np.allclose(rate[smooth], slope[smooth], atol=2e-7)


def gain(frequency_hz, mode_hz, zeta):
    s, w = 2j * math.pi * frequency_hz, 2.0 * math.pi * mode_hz
    return s * s / (s * s + 2.0 * zeta * w * s + w * w)


@pytest.mark.parametrize("frequency_hz", [5.0, 40.0, 79.0, 80.0, 100.0, 300.0])
def test_a_flexible_mode_answers_a_sine_with_its_transfer_function(frequency_hz):
    period_s = 1e-4
    t = np.arange(60_000) * period_s
    response = flexible(np.sin(2.0 * math.pi * frequency_hz * t), period_s)
    whole = gain(frequency_hz, 80.0, 0.02)
    settled = abs(whole) * np.sin(2.0 * math.pi * frequency_hz * t + np.angle(whole))
    # straight lines instead of a sine lose (w T)^2/12 of what the spring passes on
    tolerance = (1.0 + abs(whole)) * (2.0 * math.pi * frequency_hz * period_s) ** 2 / 6.0 + 1e-6
    assert np.allclose(response[40_000:], settled[40_000:], atol=tolerance)


@settings(max_examples=50)
@given(
    st.floats(1e-5, 0.2),
    st.floats(1.0, 400.0),
    st.floats(0.0, 0.99),
    st.integers(0, 1000),
)
def test_a_flexible_mode_is_exact_for_accelerations_of_straight_lines(
    period_s, frequency_hz, damping_ratio, seed
):
    a = np.random.default_rng(seed).normal(size=40) * 10.0
    a[0] = 0.0
    w = 2.0 * math.pi * frequency_hz
    system = ([1.0, 0.0, 0.0], [1.0, 2.0 * damping_ratio * w, w * w])
    _, exact, _ = lsim(system, a, np.arange(40) * period_s)
    ours = flexible(a, period_s, frequency_hz, damping_ratio)
    assert np.allclose(ours, exact, atol=1e-6 * abs(a).max())


def test_an_undamped_mode_neither_grows_nor_decays_at_a_low_sample_rate():
    a = np.zeros(100_000)
    a[1] = 1.0
    ringing = flexible(a, 1.0 / 200.0, 93.0, 0.0)
    early, late = abs(ringing[10:1010]).max(), abs(ringing[-1000:]).max()
    assert late == pytest.approx(early, rel=1e-3)


def test_a_mode_at_rest_begins_with_the_acceleration_itself():
    assert flexible(np.full(3, 7.0), 2e-4)[0] == 7.0


def test_a_tick_that_takes_no_time_changes_no_memory():
    effects = EffectList(
        [form("presliding", displacement_m=XS), form("flexible_mode", frequency_hz=50.0)]
    )
    context, none = np.zeros(effects.context_size), np.zeros((0, 3))
    for k in range(20):
        effects.kernels.advance_context(k * 1e-6, 0.0, 3.0, 2e-4, none, context)
    before = context.copy()
    effects.kernels.advance_context(19 * 1e-6, 0.0, 3.0, 0.0, none, context)
    assert (context == before).all()


def test_the_other_axes_motion_reaches_its_columns():
    effect = form("cross_axis", axes=("y", "z"))
    others = np.random.default_rng(3).normal(size=(50, 2, 3))
    zero = np.zeros(50)
    psi = state_columns(effect, zero, zero, zero, zero, zero, others)
    assert [p.name for p in effect.parameters] == [
        "acceleration_y", "velocity_y", "acceleration_z", "velocity_z",
    ]  # fmt: skip
    expected = [others[:, 0, 2], others[:, 0, 1], others[:, 1, 2], others[:, 1, 1]]
    assert (psi == np.array(expected)).all()
