"""A drive stage with hysteresis: plays side by side, as Prandtl and Ishlinskii have them."""

import numpy as np
import pytest
from effect_forms import form
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.model import EffectList
from motorctl.model.columns import input_columns

PLAY_V = 0.8


def acting(u, shares=(0.4,), play_v=PLAY_V):
    """Return what acts for a command, from rest on."""
    effect = form("drive_hysteresis", play_v=play_v, plays=len(shares))
    still = np.zeros_like(u)
    return u + np.array(shares) @ -input_columns(effect, u, still, still, np.arange(len(u)) * 1e-3)


def plays(u, widths):
    """Follow a command with plays of half such widths, in plain Python."""
    at = np.zeros(len(widths))
    found = []
    for value in u:
        at = np.maximum(np.minimum(at, value + np.array(widths)), value - np.array(widths))
        found.append(at)
    return np.array(found).T


def turning(seed: int, n: int = 300) -> np.ndarray:
    """Return a command that turns back often."""
    return np.cumsum(np.random.default_rng(seed).normal(size=n)) * 0.2


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    play_v=st.floats(1e-3, 10.0),
    shares=st.lists(st.floats(0.0, 0.3), min_size=1, max_size=3),
)
def test_a_part_of_the_command_follows_each_play(seed, play_v, shares):
    u, n = turning(seed), len(shares)
    p = plays(u, [play_v * k / n for k in range(1, n + 1)])
    expected = u - np.array(shares) @ (u - p)
    assert np.allclose(acting(u, shares, play_v), expected, rtol=1e-9, atol=1e-9)


def test_a_first_small_command_is_answered_less_and_a_large_one_loses_no_more():
    u = np.linspace(0.0, 4.0, 401)
    v = acting(u)
    assert np.allclose(v[u <= PLAY_V], 0.6 * u[u <= PLAY_V])
    assert np.allclose(v[u >= PLAY_V], u[u >= PLAY_V] - 0.4 * PLAY_V)


def test_a_command_that_swings_encloses_the_area_of_its_loop():
    # each swing moves the play over 2 (U - r), against r q both ways
    swing = 3.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, 60_001))
    v = acting(swing)
    last = slice(40_000, 60_001)
    lost = abs(np.trapezoid(v[last], swing[last]))
    assert lost == pytest.approx(4.0 * 0.4 * PLAY_V * (3.0 - PLAY_V), rel=1e-3)


@pytest.mark.slow
@settings(max_examples=40)
@given(seed=st.integers(0, 10_000), u=st.floats(-5.0, 5.0))
def test_after_any_past_the_command_can_be_inverted(seed, u):
    effects = EffectList([form("drive_hysteresis", play_v=PLAY_V, plays=3)])
    theta = np.array([p.upper for p in effects.parameters])
    context = np.zeros(effects.context_size)
    for past in turning(seed, 40):
        effects.kernels.advance_inputs(past, 1e-3, context)
    low, high = (
        effects.kernels.input_map(u + d, 0.0, 0.0, 0.0, context, theta) for d in (-1e-3, 1e-3)
    )
    assert high - low > 0.09 * 2e-3


def test_a_loop_that_would_give_energy_is_out_of_bounds():
    assert {p.lower for p in form("drive_hysteresis", play_v=1.0, plays=2).parameters} == {0.0}
