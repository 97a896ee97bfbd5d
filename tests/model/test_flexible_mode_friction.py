"""A part on a spring that slides on a guide of its own is braked by it, and sticks."""

import math

import numpy as np
import pytest
from effect_forms import form
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from motorctl.model import Spans, effect_class
from motorctl.model.columns import state_columns

HZ, ZETA, RATE_HZ = 12.0, 0.05, 5000.0
OMEGA = 2.0 * math.pi * HZ


def column(x, v, a, friction_m_s2):
    """Return the spring's push less the carriage's acceleration."""
    effect = form("flexible_mode", frequency_hz=HZ, damping_ratio=ZETA, friction_m_s2=friction_m_s2)
    t = np.arange(len(x)) / RATE_HZ
    return state_columns(effect, x, v, a, v, t)[0]


def sine(amplitude_m, frequency_hz, duration_s=4.0):
    """Return a motion that begins at rest: its place, velocity and acceleration."""
    t = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    w = 2.0 * math.pi * frequency_hz
    x = amplitude_m * (1.0 - np.cos(w * t))
    return x, amplitude_m * w * np.sin(w * t), amplitude_m * w * w * np.cos(w * t)


@given(st.floats(0.01, 1.0), st.sampled_from([-1.0, 1.0]), st.floats(0.1, 5.0))
def test_a_part_that_slides_steadily_hangs_back_by_its_friction(speed, way, friction_m_s2):
    t = np.arange(int(3.0 * RATE_HZ)) / RATE_HZ
    v = np.full_like(t, way * speed)
    push = column(v * t, v, np.zeros_like(t), friction_m_s2)
    assert push[-1] == pytest.approx(way * friction_m_s2, rel=1e-3)


def test_a_part_that_sticks_is_a_spring_to_the_ground():
    x, v, a = sine(1e-4, 3.0)
    assert 4.0 * OMEGA**2 * np.max(x) < 20.0  # the spring never pulls as hard as friction holds
    push = column(x, v, a, 20.0)
    held = OMEGA**2 * (x - x[0]) + 2.0 * ZETA * OMEGA * v - a
    assert np.max(np.abs(push - held)) < 5e-3 * np.max(np.abs(held))


def test_a_part_at_rest_keeps_still():
    x, v, a = sine(0.02, 2.0, duration_s=1.0)
    rest = np.zeros(int(3.0 * RATE_HZ))
    there = np.full_like(rest, x[-1])
    push = column(
        np.concatenate([x, there]), np.concatenate([v, rest]), np.concatenate([a, rest]), 1.5
    )
    late = push[-int(RATE_HZ) :]
    assert np.ptp(late) < 2e-4
    assert abs(late[0]) <= 1.5


@pytest.mark.parametrize("friction_m_s2", [0.3, 1.5, 4.0])
def test_it_moves_as_a_second_mass_with_dry_friction(friction_m_s2):
    w1, w2 = 2.0 * math.pi * 1.3, 2.0 * math.pi * 4.1
    t = np.arange(int(4.0 * RATE_HZ)) / RATE_HZ

    def carriage(t):
        x = 0.05 * (1.0 - np.cos(w1 * t)) + 0.01 * (1.0 - np.cos(w2 * t))
        v = 0.05 * w1 * np.sin(w1 * t) + 0.01 * w2 * np.sin(w2 * t)
        return x, v, 0.05 * w1 * w1 * np.cos(w1 * t) + 0.01 * w2 * w2 * np.cos(w2 * t)

    def part(t, y):
        x, v, _ = carriage(t)
        pushed = OMEGA**2 * (x - y[0]) + 2.0 * ZETA * OMEGA * (v - y[1])
        return [y[1], pushed - friction_m_s2 * math.tanh(y[1] / 1e-4)]

    x, v, a = carriage(t)
    solved = solve_ivp(part, (0.0, t[-1]), [0.0, 0.0], "LSODA", t, rtol=1e-8, atol=1e-10)
    pushed = OMEGA**2 * (x - solved.y[0]) + 2.0 * ZETA * OMEGA * (v - solved.y[1])
    push = column(x, v, a, friction_m_s2)
    later = t > 1.0  # the carriage begins with a jump of its acceleration
    error = push[later] - (pushed - a)[later]
    assert np.std(error) < 0.02 * np.std((pushed - a)[later])


@pytest.mark.parametrize("turns", [0.1, 0.2, 0.4])
@pytest.mark.parametrize("damping_ratio", [0.03, 0.3])
def test_a_part_that_slides_is_braked_alike_at_any_sample_rate(turns, damping_ratio):
    """Turns of the resonance in a sample."""
    effect = form("flexible_mode", frequency_hz=HZ, damping_ratio=damping_ratio, friction_m_s2=1.5)
    t = np.arange(1000) * turns / HZ
    v = np.full_like(t, 0.4)
    push = state_columns(effect, 0.4 * t, v, np.zeros_like(t), v, t)[0]
    assert push[-1] == pytest.approx(1.5, rel=1e-3)


@pytest.mark.parametrize(("share", "friction_m_s2"), [(0.4, 1.5), (0.4, 4.0), (0.7, 3.0)])
def test_on_the_acceleration_of_a_rigid_machine_it_moves_as_two_masses(share, friction_m_s2):
    """The carriage is shaken by a force; the part hangs on it, and rubs."""
    t = np.arange(int(4.0 * RATE_HZ)) / RATE_HZ
    force = 9.0 * np.sin(2.0 * math.pi * 1.3 * t) + 6.0 * np.sin(2.0 * math.pi * 3.7 * t)

    def two(t, y):
        pushed = OMEGA**2 * (y[0] - y[2]) + 2.0 * ZETA * OMEGA * (y[1] - y[3])
        shaken = np.interp(t, times, force)
        carriage = (shaken - share * pushed) / (1.0 - share)
        return [y[1], carriage, y[3], pushed - friction_m_s2 * math.tanh(y[3] / 1e-4)]

    times = t
    solved = solve_ivp(two, (0.0, t[-1]), np.zeros(4), "LSODA", t, rtol=1e-7, atol=1e-9)
    x, v = solved.y[0], solved.y[1]
    pushed = OMEGA**2 * (x - solved.y[2]) + 2.0 * ZETA * OMEGA * (v - solved.y[3])
    true = (force - share * pushed) / (1.0 - share)
    own = form("flexible_mode", frequency_hz=HZ, damping_ratio=ZETA, friction_m_s2=friction_m_s2)
    rigid, (weight,) = own.on_rigid_acceleration((share,))
    told = force - weight * state_columns(rigid, x, v, force, v, t)[0]
    assert np.std(told - true) < 0.03 * np.std(true)


def test_parts_are_tried_with_friction_where_it_shows_and_lets_them_slide():
    spans = Spans(
        position_m=(-0.2, 0.2), speed_m_s=1.0, acceleration_m_s2=10.0, command_v=8.0,
        time_s=(0.0, 20.0), period_s=2e-4, band_hz=200.0, resolution_m=1e-6,
    )  # fmt: skip
    tried = [effect.options for effect in effect_class("flexible_mode").trials(spans)]
    rubbing = [options for options in tried if options.friction_m_s2 > 0.0]
    assert rubbing
    stretched = [
        options.friction_m_s2 / (2.0 * math.pi * options.frequency_hz) ** 2 for options in rubbing
    ]
    assert min(stretched) > 5.0 * spans.resolution_m
    assert max(stretched) < 0.2 * spans.travel_m
