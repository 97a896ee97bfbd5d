"""Assumption 2 as half-planes, against looking at the slope everywhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from law_bench import C1_NAMES, C2_NAMES, X_LOWER, X_UPPER, effects
from own_saturation import OwnSaturation

from motorctl.control import monotonicity_half_planes
from motorctl.errors import UsageError
from motorctl.model import EffectList, effect_class, make_effect

EM = effects("inertia", "em_quadratic", "em_cubic")
UNEVEN = EffectList([make_effect(effect_class("inertia")), OwnSaturation()])
U_MAX = 10.0


def even_slopes(u: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros_like(u), 2 * np.abs(u), 3 * u * u])


def uneven_slopes(u: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros_like(u), 2 * np.abs(u), 2 * u])


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.sampled_from([(EM, even_slopes, (0.3, 0.03)), (UNEVEN, uneven_slopes, (0.2, 0.2))]),
    st.tuples(*[st.floats(-1.0, 0.9)] * 2),
    st.tuples(*[st.floats(0.05, 1.0)] * 2),
    st.floats(0.02, 0.5),
    st.integers(0, 2**32 - 1),
)
def test_the_half_planes_admit_what_a_fine_grid_admits(kind, low, width, margin, seed):
    model, slopes_of, scale = kind
    low = np.array([0.1, *(np.array(low) * scale)])
    high = low + np.array([1.0, *(np.array(width) * scale)])
    normals, offsets = monotonicity_half_planes(model, low, high, U_MAX, margin)
    theta = np.random.default_rng(seed).uniform(low, high, (1000, 3))
    slopes = 1 + theta @ slopes_of(np.linspace(-U_MAX, U_MAX, 1001)).T
    admitted = (theta @ normals.T >= offsets).all(axis=1)
    lowest = slopes.min(axis=1)
    assert lowest[admitted].min(initial=margin) >= margin - 2e-3 * max(scale[1] * 100, 1)
    assert lowest[~admitted].max(initial=0.0) < margin + 1e-9


def test_a_box_that_keeps_assumption_2_by_itself_needs_no_half_plane():
    normals, _ = monotonicity_half_planes(
        effects(*C2_NAMES), np.array(X_LOWER), np.array(X_UPPER), U_MAX, 0.05
    )
    assert normals.shape == (0, 6)


def test_falling_input_maps_need_the_half_plane_at_the_end_of_the_range_only():
    lower, upper = np.array([0.1, -0.1, -0.01]), np.array([1.0, 0.0, 0.0])
    normals, offsets = monotonicity_half_planes(EM, lower, upper, U_MAX, 0.05)
    assert normals.tolist() == [[0.0, 2 * U_MAX, 3 * U_MAX**2]]
    assert offsets.tolist() == [pytest.approx(0.05 - 1.0)]


def test_a_list_without_input_effects_needs_no_half_plane():
    lower, upper = np.full(4, -1e3), np.full(4, 1e3)
    normals, _ = monotonicity_half_planes(effects(*C1_NAMES), lower, upper, U_MAX, 0.05)
    assert len(normals) == 0


def test_the_widest_bounds_of_the_electromagnetic_effects_can_be_kept():
    lower, upper = np.array([0.1, -1.0, -0.1]), np.array([1.0, 1.0, 0.1])
    normals, offsets = monotonicity_half_planes(EM, lower, upper, U_MAX, 0.05)
    theta = np.random.default_rng(3).uniform(lower, upper, (20000, 3))
    admitted = (theta @ normals.T >= offsets).all(axis=1)
    slopes = 1 + theta[admitted] @ even_slopes(np.linspace(0, U_MAX, 2001)).T
    assert admitted.sum() > 100
    assert slopes.min() > 0.04


def test_parameters_of_the_input_map_need_finite_bounds():
    lower, upper = np.array([0.1, -np.inf, -0.1]), np.array([1.0, 0.0, 0.0])
    with pytest.raises(UsageError, match="finite lower and upper bounds"):
        monotonicity_half_planes(EM, lower, upper, U_MAX, 0.05)
