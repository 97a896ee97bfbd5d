"""The inverse of the input map: exact, in range and monotonic over every admissible map."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_bench import C1_NAMES, effects

from motorctl.control import invert

EM = effects("inertia", "em_quadratic", "em_cubic").kernels
NONE = effects(*C1_NAMES).kernels
MARGIN = 0.05
NO_MEMORY = np.zeros(0)


def inverse(v: float, theta5: float, theta6: float, u_max: float) -> float:
    theta = np.array([0.2, theta5, theta6])
    return invert(EM.input_map, EM.input_slope, v, 0.0, 0.0, 0.0, NO_MEMORY, theta, u_max)


def mapped(u: float, theta5: float, theta6: float) -> float:
    return u + theta5 * u * abs(u) + theta6 * u**3


@st.composite
def maps(draw: st.DrawFn) -> tuple[float, float, float]:
    """theta5, theta6 and u_max of a map whose slope stays above the margin, up to the very edge."""
    u_max = draw(st.floats(0.5, 100.0))
    tiny = st.sampled_from([0.0, 1e-300, -1e-300, 1e-12, -1e-12, 1e-11, -1e-11, -0.0])
    quadratic = draw(tiny | st.floats(-3.0, 3.0)) / u_max
    cubic = draw(tiny | st.floats(-3.0, 3.0)) / u_max**2
    slopes = [1 + 2 * quadratic * u + 3 * cubic * u * u for u in np.linspace(0, u_max, 400)]
    lowest = min(slopes)
    if lowest < MARGIN:  # shrink both towards the identity, onto the edge
        share = (1 - MARGIN) / (1 - lowest)
        quadratic, cubic = quadratic * share, cubic * share
    return quadratic, cubic, u_max


@given(maps(), st.floats(-1.0, 1.0))
def test_the_input_map_of_the_inverse_is_the_virtual_command(admissible, share):
    theta5, theta6, u_max = admissible
    v = share * mapped(u_max, theta5, theta6)
    u = inverse(v, theta5, theta6, u_max)
    assert abs(u) <= u_max
    assert abs(mapped(u, theta5, theta6) - v) <= 1e-12 * max(1.0, u_max / 10)


@given(maps(), st.lists(st.floats(-1.5, 1.5), min_size=2, max_size=30))
def test_the_inverse_rises_with_the_virtual_command(admissible, shares):
    theta5, theta6, u_max = admissible
    full = mapped(u_max, theta5, theta6)
    commands = [inverse(share * full, theta5, theta6, u_max) for share in sorted(shares)]
    assert all(later >= earlier - 1e-12 * u_max for earlier, later in pairwise(commands))


@given(maps(), st.floats(1.0 + 1e-12, 1e6))
def test_the_inverse_stands_at_the_limit_beyond_the_branch(admissible, share):
    theta5, theta6, u_max = admissible
    v = share * mapped(u_max, theta5, theta6)
    assert inverse(v, theta5, theta6, u_max) == u_max
    assert inverse(-v, theta5, theta6, u_max) == -u_max
    assert inverse(math.inf, theta5, theta6, u_max) == u_max


@given(st.floats(-50.0, 50.0))
def test_the_inverse_is_odd_where_the_map_is(v):
    assert inverse(-v, -0.01, -0.001, 10.0) == -inverse(v, -0.01, -0.001, 10.0)


@given(st.floats(-10.0, 10.0))
def test_a_list_without_input_effects_commands_what_the_law_asks_for(v):
    theta = np.array([0.2, 0.2, 0.1, 0.0])
    assert invert(NONE.input_map, NONE.input_slope, v, 0.0, 0.0, 0.0, NO_MEMORY, theta, 10.0) == v


@given(st.floats(10.0, 1e9))
def test_a_list_without_input_effects_saturates(v):
    theta = np.array([0.2, 0.2, 0.1, 0.0])
    assert (
        invert(NONE.input_map, NONE.input_slope, v, 0.0, 0.0, 0.0, NO_MEMORY, theta, 10.0) == 10.0
    )
    assert (
        invert(NONE.input_map, NONE.input_slope, -v, 0.0, 0.0, 0.0, NO_MEMORY, theta, 10.0) == -10.0
    )


@pytest.mark.parametrize("theta6", [-1e-8, -1e-10, -1e-11, -1e-12, -1e-15, 0.0, 1e-12])
def test_digits_are_kept_where_the_cubic_part_vanishes(theta6):
    # Cardano's formula is 1.85 V off at theta6 = -1e-11.
    for v in np.linspace(-9.0, 9.0, 37):
        u = inverse(v, -0.005, theta6, 10.0)
        quadratic = (1 - math.sqrt(1 - 4 * 0.005 * abs(v))) / (2 * 0.005) * np.sign(v)
        assert abs(u - quadratic) <= 1e-12 + 1.5e3 * abs(theta6)
        assert abs(mapped(u, -0.005, theta6) - v) <= 1e-12


@pytest.mark.parametrize(
    ("v", "theta5", "theta6"),
    [(math.nan, -0.01, -0.001), (1.0, math.nan, -0.001), (1.0, 0.0, math.nan)],
)
def test_a_number_that_is_none_never_becomes_a_voltage(v, theta5, theta6):
    assert math.isnan(inverse(v, theta5, theta6, 10.0))
