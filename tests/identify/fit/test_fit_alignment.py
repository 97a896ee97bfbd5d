"""Alignment of the held command, against integration by brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.identify.columns.command_timing import hold_taps, sample_taps

DELAYS = st.floats(-4.0, 12.0)
HALF_WIDTHS = st.sampled_from([1, 2])


def test_the_hold_without_delay_is_the_mean_of_two_commands():
    taps = hold_taps(0.0, 1)
    assert taps.lags.tolist() == [0, 1]
    np.testing.assert_allclose(taps.weights, [0.5, 0.5])


@given(DELAYS, HALF_WIDTHS)
def test_weights_sum_to_one_and_delay_by_half_a_sample_more(delay, half_width):
    taps = hold_taps(delay, half_width)
    assert taps.weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert taps.lags @ taps.weights == pytest.approx(delay + 0.5, abs=1e-9)
    assert len(taps.lags) <= 2 * half_width + 1


@given(DELAYS, HALF_WIDTHS)
def test_weights_are_the_triangle_integrated_over_each_hold(delay, half_width):
    taps = hold_taps(delay, half_width)
    # midpoints of a fine grid over the triangle around tick 0
    s = (np.arange(40000) + 0.5) / 20000.0 - 1.0
    triangle = (1.0 - np.abs(s)) / 20000.0
    # at time s the command of tick floor(s - delay) is in force: u_{0 - lag}
    in_force = -np.floor(half_width * s - delay).astype(int)
    for lag, weight in zip(taps.lags, taps.weights, strict=True):
        assert weight == pytest.approx(triangle[in_force == lag].sum(), abs=2e-4)


@given(DELAYS)
def test_samples_without_hold_are_interpolated_at_the_delay(delay):
    taps = sample_taps(delay)
    assert taps.weights.sum() == pytest.approx(1.0)
    assert taps.lags @ taps.weights == pytest.approx(delay, abs=1e-9)
