"""Backlash: a load that glides through a gap, and is fixed as long as one flank is in touch."""

from dataclasses import replace

import numpy as np
import pytest
from effect_forms import form
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from motorctl.model import effect_class
from motorctl.model.columns import state_columns
from motorctl.model.contract import ORDINARY

GAP_M, GLIDE, HZ, DAMPING = 1e-3, 2.0, 80.0, 0.8
PERIOD_S = 2e-4


def push(x, v, period_s=PERIOD_S, **options):
    """Return what the load's push has beyond that of a fixed load, per mass."""
    effect = form("backlash", **({"gap_m": GAP_M, "glide_m_s2": GLIDE, "contact_hz": HZ} | options))
    still, t = np.zeros_like(x), np.arange(len(x)) * period_s
    return state_columns(effect, x, v, still, v, t)[0]


def swing(amplitude_m, hz, duration_s=2.0, period_s=PERIOD_S):
    """Return x and v of a sine that begins at rest."""
    t = np.arange(0.0, duration_s, period_s)
    w = 2.0 * np.pi * hz
    return amplitude_m * (1.0 - np.cos(w * t)), amplitude_m * w * np.sin(w * t), t


def test_a_motion_within_the_gap_never_touches_the_load():
    # the load stays where it is, and a fixed one would have to be accelerated: that is missing
    x, v, t = swing(0.2 * GAP_M, 3.0)
    w = 2.0 * np.pi * 3.0
    a = 0.2 * GAP_M * w * w * np.cos(w * t)
    found = push(x, v, glide_m_s2=0.0)
    assert np.allclose(found[500:], -a[500:], atol=0.02 * abs(a).max())


def test_a_load_that_one_flank_holds_is_a_fixed_load():
    # faster and faster one way: after the first touch nothing is missing
    t = np.arange(0.0, 2.0, PERIOD_S)
    found = push(0.5 * 3.0 * t**2, 3.0 * t)
    touched = np.flatnonzero(t > 0.2)[0]
    assert abs(found[touched:]).max() < 1e-3 * 3.0
    assert abs(found[:touched]).max() > 3.0


def test_a_load_with_much_friction_crosses_the_gap_at_reversals_alone():
    # slowed down by less than its own friction, the load stays on the flank
    w = 2.0 * np.pi
    x, v, t = swing(0.02, 1.0, 4.0)
    assert 0.02 * w * w < GLIDE
    found = push(x, v)
    away = abs(found) > 0.1
    since = np.mod(t + 1e-9, 0.5)  # it turns back each half second
    assert away[t > 0.7].any()
    assert (since[away & (t > 0.7)] < 0.15).all()


def test_a_load_with_viscous_friction_reaches_the_other_flank_later_or_never():
    # the motor speeds up with it and stands still: it goes on at the motor's last speed
    speed, stops_s = 0.02, 0.5
    t = np.arange(0.0, 2.0, PERIOD_S)
    x = 0.5 * speed / stops_s * np.minimum(t, stops_s) ** 2
    v = np.where(t < stops_s, speed * t / stops_s, 0.0)
    after = t > stops_s + 0.03  # what the stop itself takes has passed

    def blows(slows_1_s):
        found = push(x, v, glide_m_s2=0.0, slows_1_s=slows_1_s)
        hit = np.flatnonzero(after & (abs(found) > 0.1))
        return t[hit[0]] - stops_s if len(hit) else np.inf

    for slows_1_s in (0.0, 5.0, 15.0):
        part = slows_1_s * GAP_M / speed  # of its speed is lost on the way
        expected_s = GAP_M / speed if part == 0.0 else -np.log1p(-part) / slows_1_s
        assert abs(blows(slows_1_s) - expected_s) < 0.1 * expected_s
    assert blows(1.5 * speed / GAP_M) == np.inf


def test_over_a_whole_swing_the_load_gets_what_a_fixed_one_gets():
    # both start and end each swing with the same speed and have been braked alike
    x, v, t = swing(0.05, 2.0, 3.0)
    found = push(x, v)
    whole = (t >= 1.0) & (t < 3.0)
    assert abs(found[whole].mean()) < 0.02 * abs(found[whole]).mean()


@pytest.mark.slow
def test_the_push_is_that_of_the_two_bodies_equations():
    # solved once more by scipy, with events of its own step control
    x_of = lambda t: 0.01 * (1.0 - np.cos(20.0 * t))  # noqa: E731
    v_of = lambda t: 0.2 * np.sin(20.0 * t)  # noqa: E731
    w = 2.0 * np.pi * HZ

    def pushes(t, q, p):
        ahead = x_of(t) - q
        depth = ahead - np.copysign(0.5 * GAP_M, ahead) if abs(ahead) > 0.5 * GAP_M else 0.0
        force = w * w * depth + 2.0 * DAMPING * w * (v_of(t) - p) if depth else 0.0
        joint = w * w * ahead + 2.0 * DAMPING * w * (v_of(t) - p)
        return (force if force * ahead > 0.0 else 0.0), joint

    def rates(t, y):
        q, p, fixed, speed = y
        return [p, pushes(t, q, p)[0], speed, pushes(t, fixed, speed)[1]]

    times = np.arange(0.0, 1.0, PERIOD_S)
    y = solve_ivp(rates, (0.0, 1.0), np.zeros(4), t_eval=times, max_step=5e-5, rtol=1e-8).y
    expected = [
        pushes(t, q, p)[0] - pushes(t, fixed, speed)[1]
        for t, q, p, fixed, speed in zip(times, *y, strict=True)
    ]
    found = push(x_of(times), v_of(times), glide_m_s2=0.0)
    rms = np.sqrt(np.mean(np.square(expected)))
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.15 * rms


@settings(max_examples=50)
@given(
    seed=st.integers(0, 1000),
    gap_m=st.floats(1e-9, 1.0),
    glide=st.floats(0.0, 1e3),
    hz=st.floats(1.0, 1e4),
    period_s=st.floats(1e-5, 1.0),
)
def test_it_stays_finite_at_any_sample_rate(seed, gap_m, glide, hz, period_s):
    rng = np.random.default_rng(seed)
    x, v = np.cumsum(rng.normal(size=300)) * 0.1, rng.normal(size=300) * 10.0
    found = push(x, v, period_s, gap_m=gap_m, glide_m_s2=glide, contact_hz=hz)
    assert np.isfinite(found).all()


def test_the_load_cannot_weigh_less_than_nothing():
    assert form("backlash", gap_m=GAP_M, glide_m_s2=1.0).parameters[0].lower == 0.0


def test_a_gap_is_not_sought_where_the_axis_never_turns_round():
    assert effect_class("backlash").trials(ORDINARY)
    assert not effect_class("backlash").trials(replace(ORDINARY, one_way=True))


def test_a_gap_of_less_than_a_few_counts_is_not_sought():
    forms = effect_class("backlash").trials(ORDINARY)
    assert min(f.options.gap_m for f in forms) > 5.0 * ORDINARY.resolution_m
