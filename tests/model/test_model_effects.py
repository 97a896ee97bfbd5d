"""The list of effects becomes compiled kernels: regressor, feedforward, input map."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_bench import C1_NAMES, C2_NAMES, effects
from own_saturation import OwnSaturation
from seventh_effect import SeventhEffect, WaveOptions

from motorctl.errors import UsageError
from motorctl.model import EffectList, effect_class, make_effect

C2 = effects(*C2_NAMES)
NO_MEMORY = np.zeros(0)
MIXED = EffectList(
    [
        OwnSaturation(),
        make_effect(effect_class("offset")),
        SeventhEffect(WaveOptions(pitch_m=0.05)),
        make_effect(effect_class("inertia")),
    ]
)
moderate = st.floats(-20.0, 20.0)


def signals(seed: int, n: int = 40) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.normal(size=n) * scale for scale in (0.3, 0.5, 20.0, 0.5, 10.0, 6.0)]


def test_the_regressor_holds_the_published_columns():
    x, v, a, vs, t, u = signals(1)
    psi = C2.regressor(x, v, a, vs, t, u)
    expected = [a, v, 2 / math.pi * np.arctan(900 * vs), np.full_like(x, -1), -u * abs(u), -(u**3)]
    assert np.allclose(psi, np.column_stack(expected), rtol=1e-14)


def test_the_regressor_follows_the_order_of_the_list():
    x, v, a, vs, t, u = signals(2)
    psi = MIXED.regressor(x, v, a, vs, t, u)
    wave = 2 * math.pi / 0.05 * x
    expected = [-u * abs(u), -u * u, np.full_like(x, -1), np.sin(wave), np.cos(wave), a]
    assert np.allclose(psi, np.column_stack(expected), rtol=1e-12)
    assert MIXED.parameter_names == (
        "own_saturation_quadratic", "own_saturation_skew", "offset",
        "seventh_effect_sin", "seventh_effect_cos", "inertia",
    )  # fmt: skip
    assert len(MIXED) == 6


@given(st.sampled_from([C2, MIXED]), st.integers(0, 1000), st.integers(0, 1000))
def test_the_command_that_solves_the_model_gives_the_regressor_times_theta(model, seed, other):
    # u = psi theta is v(u) = the feedforward, whatever the list.
    theta = np.random.default_rng(other).normal(size=len(model)) * 0.01
    x, v, a, vs, t, u = (signal[:1] for signal in signals(seed))
    psi = model.regressor(x, v, a, vs, t, u)[0]
    motion = [float(signal[0]) for signal in (x, v, a, vs, t)]
    lhs = model.kernels.input_map(u[0], x[0], vs[0], t[0], NO_MEMORY, theta) - u[0]
    feedforward = model.kernels.feedforward(*motion, np.zeros(0), theta)
    assert psi @ theta == pytest.approx(feedforward - lhs, abs=1e-9)


@given(st.sampled_from([C2, MIXED]), moderate, st.integers(0, 1000))
def test_the_slope_is_the_derivative_of_the_input_map(model, u, seed):
    theta = np.random.default_rng(seed).normal(size=len(model)) * 0.01
    h = 1e-5
    kernels = model.kernels
    up, down = (kernels.input_map(u + d, 0.1, 0.2, 0.0, NO_MEMORY, theta) for d in (h, -h))
    slope = kernels.input_slope(u, 0.1, 0.2, 0.0, NO_MEMORY, theta)
    assert slope == pytest.approx((up - down) / (2 * h), abs=1e-4)


def test_the_tick_and_the_analysis_run_the_same_columns():
    x, v, a, vs, t, u = signals(3)
    psi = MIXED.regressor(x, v, a, vs, t, u)
    row = np.zeros(len(MIXED) + 1)
    for k in range(len(x)):
        MIXED.kernels.state_columns(x[k], v[k], a[k], vs[k], t[k], np.zeros(0), row)
        state = row[:-1].copy()
        MIXED.kernels.input_columns(u[k], x[k], vs[k], t[k], NO_MEMORY, row)
        assert (state + row[:-1] == psi[k]).all()


def test_c1_runs_the_list_without_the_electromagnetic_effects():
    assert C2.without_electromagnetic().names == C1_NAMES
    assert MIXED.without_electromagnetic().names == MIXED.names


def test_the_sign_function_may_be_infinitely_steep():
    steep = make_effect(effect_class("coulomb_friction"), {"slope_s_m": math.inf})
    feedforward = EffectList([steep]).kernels.feedforward
    speeds = (-1.0, -1e-12, 0.0, 1e-12, 1.0)
    values = [feedforward(0.0, 0.0, 0.0, vs, 0.0, np.zeros(0), np.ones(1)) for vs in speeds]
    assert values == [-1.0, -1.0, 0.0, 1.0, 1.0]


def test_lists_that_differ_in_a_constant_do_not_share_kernels():
    lists = [EffectList([SeventhEffect(WaveOptions(pitch_m=p))]) for p in (0.05, 0.06)]
    values = [
        m.kernels.feedforward(0.0125, 0.0, 0.0, 0.0, 0.0, np.zeros(0), np.array([1.0, 0.0]))
        for m in lists
    ]
    assert values[0] == pytest.approx(1.0)
    assert values[1] == pytest.approx(math.sin(2 * math.pi * 0.0125 / 0.06))


def test_a_list_travels_to_another_process_and_has_its_kernels_there():
    copy = pickle.loads(pickle.dumps(MIXED))
    assert copy.parameter_names == MIXED.parameter_names
    assert copy.module_name == MIXED.module_name


def test_signals_of_different_lengths_are_refused():
    x, v, a, vs, t, u = signals(1)
    with pytest.raises(ValueError, match="shape"):
        C2.regressor(x, v, a, vs, t, u[:-1])


def test_an_effect_cannot_stand_in_a_list_twice():
    with pytest.raises(UsageError, match="'offset' stands in the list twice"):
        effects("offset", "inertia", "offset")


@pytest.mark.parametrize(
    ("name", "type_name", "said"),
    [
        ("cogwheel", None, "unknown effect 'cogwheel'; known: .*inertia"),
        ("wave", "no_such_module:Wave", "failed to import: ModuleNotFoundError"),
        ("wave", "seventh_effect:Wave", "failed to import: AttributeError"),
        ("wave", "seventh_effect:SeventhEffect", "calls itself 'seventh_effect'"),
        ("wave", "seventh_effect:WaveOptions", "is not a motorctl.model.Effect"),
    ],
)
def test_an_effect_that_cannot_be_used_is_told_in_one_message(name, type_name, said):
    with pytest.raises(UsageError, match=said):
        effect_class(name, type_name)
