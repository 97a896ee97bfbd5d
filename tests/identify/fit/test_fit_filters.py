"""Filters, derivatives and decimation on signals whose answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.identify.columns.filters import (
    acceleration_of,
    decimation_filter,
    low_pass,
    one_way,
    picked,
    settling_samples,
    velocity_of,
    zero_phase,
)

RATE_HZ = 1000.0
TIME = np.arange(4000) / RATE_HZ


@pytest.mark.parametrize("kind", ["butterworth", "bessel"])
def test_the_zero_phase_low_pass_shifts_nothing_and_halves_power_twice_at_its_edge(kind):
    edge = np.sin(2 * np.pi * 50.0 * TIME)
    filtered = zero_phase(low_pass(kind, 4, 50.0, RATE_HZ), 4, edge)
    middle = slice(500, -500)
    np.testing.assert_allclose(filtered[middle], 0.5 * edge[middle], atol=1e-3)


def test_the_forward_filter_starts_without_a_step():
    constant = np.full((300, 2), [3.0, -1.0])
    filtered = one_way(low_pass("butterworth", 4, 20.0, RATE_HZ), constant)
    np.testing.assert_allclose(filtered, constant, atol=1e-9)


@pytest.mark.parametrize(
    ("sections", "order"),
    [(low_pass("butterworth", 4, 40.0, RATE_HZ), 4), (decimation_filter(8, 10), 8)],
)
def test_a_disturbed_end_is_forgotten_after_the_settling_time(sections, order):
    settled = settling_samples(sections, 1e-4)
    quiet, disturbed = np.zeros(4000), np.zeros(4000)
    disturbed[0] = 1.0
    difference = np.abs(zero_phase(sections, order, disturbed) - zero_phase(sections, order, quiet))
    assert difference.max() > 1e-2
    assert difference[settled:].max() < 1e-4


@given(st.integers(1, 500), st.integers(1, 40))
def test_decimation_keeps_the_last_sample_and_every_nth_before_it(samples, factor):
    kept = picked(samples, factor)
    assert kept[-1] == samples - 1
    assert len(kept) == -(-samples // factor)
    assert np.all(np.diff(kept) == factor)


@pytest.mark.parametrize("how", ["second_difference", "central"])
def test_derivatives_of_a_parabola_are_exact_inside(how):
    position = 0.5 * 3.0 * TIME**2 - 2.0 * TIME
    velocity = velocity_of(position, 1.0 / RATE_HZ)
    acceleration = acceleration_of(position, velocity, 1.0 / RATE_HZ, how)
    np.testing.assert_allclose(velocity[1:-1], (3.0 * TIME - 2.0)[1:-1], atol=1e-9)
    np.testing.assert_allclose(acceleration[2:-2], 3.0, atol=1e-6)
