"""The analysis against the published figures, analytic answers and the loop in time."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.config.analysis import (
    DelayedPlant,
    LoopGains,
    command_peak,
    corner_slopes,
    gain_condition,
    loop_margins,
    open_loop,
    required_command,
    required_ks1,
    smallest_slope,
)
from motorctl.model import EffectList, effect_class, make_effect

TS = 2e-4
GAINS = {"k1_1_s": 250.0, "ks_v_s_m": 95.0, "gamma_d": 500.0, "period_s": TS}
C2 = EffectList(
    [
        make_effect(effect_class(name))
        for name in (
            "inertia",
            "viscous_friction",
            "coulomb_friction",
            "offset",
            "em_quadratic",
            "em_cubic",
        )
    ]
)
ANY_LOOP = given(
    theta1=st.floats(0.05, 1.0),
    theta2=st.floats(0.0, 1.0),
    ks=st.floats(20.0, 150.0),
    delay=st.floats(0.0, 4e-4),
)
THETA_X = np.array([0.19, 0.25, 0.1, 0.02, -0.005, -0.0005])


@pytest.mark.parametrize(
    ("theta1", "theta2", "delay_s", "phase_deg"),
    [
        (0.19, 0.25, 0.0, 60),
        (0.19, 0.25, TS, 53),
        (0.19, 0.25, TS + 0.3e-3, 44),
        (0.71, 0.3, 0.0, 37),
        (0.71, 0.3, TS + 0.3e-3, 31),
    ],
)
def test_the_margins_of_the_published_gains_are_the_published_ones(
    theta1, theta2, delay_s, phase_deg
):
    margins = loop_margins(theta1, theta2, **GAINS, delay_s=delay_s)
    assert margins.stable
    assert margins.phase_margin_deg == pytest.approx(phase_deg, abs=0.5)


def time_response(theta1, theta2, gains, delay_ticks, ticks):
    """Run the loop tick by tick from a small error; gives the positions (N,)."""
    ts, k1 = gains["period_s"], gains["k1_1_s"]
    a = theta2 / theta1
    decay = math.exp(-a * ts) if a else 1.0
    reach = (1 - decay) / a if a else ts
    x, v, x1, d0 = 1.0, 0.0, 1.0, 0.0
    waiting = [0.0] * delay_ticks
    positions = []
    for _ in range(ticks):
        p = (x - x1) / ts + k1 * x
        u = -gains["ks_v_s_m"] * p - d0
        d0 += gains["gamma_d"] * ts * p
        waiting.append(u)
        u = waiting.pop(0)
        x1 = x
        final = u / theta2 if theta2 else 0.0
        if a:
            x, v = x + final * ts + (v - final) * reach, final + (v - final) * decay
        else:
            x, v = x + v * ts + u / theta1 * ts * ts / 2, v + u / theta1 * ts
        positions.append(x)
    return np.array(positions)


@pytest.mark.parametrize("delay_ticks", [0, 1, 3])
@pytest.mark.parametrize("theta2", [0.0, 0.4])
def test_the_gain_margin_is_where_the_loop_in_time_starts_to_grow(delay_ticks, theta2):
    limit = loop_margins(0.19, theta2, **GAINS, delay_s=delay_ticks * TS).gain_margin
    for factor, grows in ((0.97, False), (1.03, True)):
        scaled = GAINS | {
            "ks_v_s_m": 95.0 * factor * limit,
            "gamma_d": 500.0 * factor * limit,
        }
        x = np.abs(time_response(0.19, theta2, scaled, delay_ticks, 4000))
        assert (x[-200:].max() > x[200:400].max()) == grows
        told = loop_margins(0.19, theta2, **scaled, delay_s=delay_ticks * TS)
        assert told.stable != grows


@settings(max_examples=25)
@ANY_LOOP
def test_the_phase_margin_is_the_delay_that_the_loop_bears(theta1, theta2, ks, delay):
    gains = GAINS | {"ks_v_s_m": ks, "gamma_d": ks}
    margins = loop_margins(theta1, theta2, **gains, delay_s=delay)
    if not margins.stable:
        return
    bears = math.radians(margins.phase_margin_deg) / margins.crossover_rad_s
    assert loop_margins(theta1, theta2, **gains, delay_s=delay + 0.98 * bears).stable
    assert not loop_margins(theta1, theta2, **gains, delay_s=delay + 1.02 * bears).stable


@settings(max_examples=25)
@ANY_LOOP
def test_at_the_margins_the_loop_passes_one_and_minus_one(theta1, theta2, ks, delay):
    gains = LoopGains(250.0, ks, ks)
    plant = DelayedPlant((theta1, theta2, 0.0), TS, delay)
    margins = loop_margins(
        theta1, theta2, k1_1_s=250.0, ks_v_s_m=ks, gamma_d=ks, period_s=TS, delay_s=delay
    )
    if not margins.stable:
        return
    at = open_loop(plant, gains, np.array([margins.crossover_rad_s]))[0]
    assert abs(at) == pytest.approx(1.0, abs=1e-6)
    assert cmath.phase(-at) == pytest.approx(math.radians(margins.phase_margin_deg), abs=1e-6)
    w = np.geomspace(10.0, math.pi / TS, 100_000)[:-1]
    loop = margins.gain_margin * open_loop(plant, gains, w)
    assert np.min(np.abs(loop + 1.0)) < 1e-3


def test_slow_loops_have_the_margins_of_continuous_time():
    """p = de/dt + k1 e over a mass: L = ks (s + k1) / (theta1 s^2), far below the sampling."""
    theta1, k1, ks = 1.0, 2.0, 6.0
    found = loop_margins(theta1, 0.0, k1_1_s=k1, ks_v_s_m=ks, gamma_d=0.0, period_s=TS)
    crossover = math.sqrt((ks**2 + math.sqrt(ks**4 + 4 * (ks * k1) ** 2)) / 2)
    assert found.crossover_rad_s == pytest.approx(crossover, rel=1e-3)
    assert found.phase_margin_deg == pytest.approx(math.degrees(math.atan(crossover / k1)), abs=0.1)


def test_a_gain_that_may_not_shrink_has_a_lower_limit():
    """With the integral of p two poles more stand at rest: too little gain and it oscillates."""
    margins = loop_margins(0.19, 0.0, **GAINS)
    below = margins.gain_reduction * 0.95
    weak = GAINS | {"ks_v_s_m": 95.0 * below, "gamma_d": 500.0 * below}
    assert 0.0 < margins.gain_reduction < 1.0
    assert not loop_margins(0.19, 0.0, **weak).stable


def test_the_sufficient_gains_are_the_published_ones():
    x = gain_condition((0.19, 0.19), (0.25, 0.25), (0.15, 0.15), 900.0, 250.0, 95.0)
    y = gain_condition((0.71, 0.71), (0.3, 0.3), (0.18, 0.18), 900.0, 250.0, 95.0)
    assert x.required_ks1_v_s_m == pytest.approx(47, abs=0.5)
    assert y.required_ks1_v_s_m == pytest.approx(177, abs=0.5)
    assert x.satisfied
    assert x.decay_1_s == 250.0
    assert not y.satisfied
    assert y.decay_1_s is None


@given(
    theta1=st.tuples(st.floats(0.05, 1.0), st.floats(0.0, 1.0)),
    theta2=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    theta3=st.tuples(st.floats(0.0, 0.5), st.floats(0.0, 0.5)),
    inside=st.tuples(*[st.floats(0.0, 1.0)] * 4),
)
def test_no_point_of_the_box_asks_for_more_than_the_box(theta1, theta2, theta3, inside):
    box = [(low, low + width) for low, width in (theta1, theta2, theta3)]
    whole = gain_condition(*box, 900.0, 250.0, 95.0).required_ks1_v_s_m
    t1, t2, t3 = (low + part * (high - low) for (low, high), part in zip(box, inside, strict=False))
    g = inside[3] * 1800.0 / math.pi
    friction = t2 + t3 * g
    assert required_ks1(t1, 250.0, (friction, friction)) <= whole * (1 + 1e-9)


def test_friction_without_a_slope_limit_can_never_be_guaranteed():
    ideal = gain_condition((0.2, 0.2), (0.2, 0.2), (0.1, 0.1), math.inf, 250.0, 95.0)
    none = gain_condition((0.2, 0.2), (0.2, 0.2), (0.0, 0.0), math.inf, 250.0, 95.0)
    assert not ideal.satisfied
    assert none.satisfied


@given(st.floats(-0.02, 0.0), st.floats(-0.002, 0.0), st.floats(1.0, 12.0))
def test_with_a_falling_cubic_assumption_2_is_the_half_plane_at_the_limit(quadratic, cubic, u_max):
    theta = np.array([0.2, 0.2, 0.1, 0.0, quadratic, cubic])
    slope, _ = smallest_slope(C2, theta, u_max)
    half_plane = 1.0 + 2.0 * u_max * quadratic + 3.0 * u_max**2 * cubic
    assert slope == pytest.approx(min(1.0, half_plane), abs=1e-12)


def test_every_corner_of_the_input_map_is_told_worst_first():
    lower, upper = [0.05, 0.08, 0.05, -0.5, -0.015, -0.003], [0.35, 0.5, 0.4, 0.5, 0.0, 0.0]
    corners = corner_slopes(C2, lower, upper, 10.0)
    assert [corner.slope for corner in corners] == pytest.approx([-0.2, 0.1, 0.7, 1.0])
    assert corners[0].theta == {"em_quadratic": -0.015, "em_cubic": -0.003}
    assert abs(corners[0].at_u_v) == 10.0
    assert corner_slopes(C2.without_electromagnetic(), lower[:4], upper[:4], 10.0) == []


@given(st.floats(-9.9, 9.9), st.floats(-1.0, 1.0))
def test_the_required_command_gives_back_the_motion(u, velocity):
    """Choose u and v; the acceleration follows from the model, and must ask for this u again."""
    theta = THETA_X
    virtual = u + theta[4] * u * abs(u) + theta[5] * u**3
    friction = theta[2] * 2 / math.pi * math.atan(900 * velocity)
    acceleration = (virtual - theta[1] * velocity - friction + theta[3]) / theta[0]
    command = required_command(C2, theta, 10.0)
    found = command(np.zeros(1), np.array([velocity]), np.array([acceleration]))[0]
    assert found == pytest.approx(u, abs=2e-5)


def test_beyond_the_limit_the_required_command_goes_on_growing():
    command = required_command(C2, THETA_X, 10.0)
    rising = np.linspace(40.0, 80.0, 20)
    needed = command(np.zeros(20), np.zeros(20), rising)
    assert (np.diff(needed) > 0).all()
    assert needed[-1] > 10.0
    assert command_peak(np.arange(20.0), -needed).command_v == -needed[-1]
    assert command_peak(np.arange(20.0), -needed).at_s == 19.0
