"""Each force of position, speed and time has the size that its formula says."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from sim_bench import Bench, bare, force_at

COULOMB = 0.139


def sf(v):
    return 2 / math.pi * math.atan(900 * v)


def gauss(z):
    return math.exp(-z * z)


KNOTS = [-0.3, -0.1, 0.0, 0.15, 0.3]
VALUES = [0.0, 0.08, -0.05, 0.1, 0.02]
PROFILE = {"position_m": KNOTS, "force_v": VALUES}


def spline(x):
    return float(CubicSpline(KNOTS, VALUES)(np.clip(x, KNOTS[0], KNOTS[-1])))


FORMULAS = {
    "cogging": (
        {
            "pitch_m": 0.05,
            "harmonics": [
                {"order": 1, "amplitude_v": 0.034, "phase_rad": 0.3},
                {"order": 2, "amplitude_v": 0.039, "phase_rad": 1.1},
                {"order": 6, "amplitude_v": 0.142},
            ],
            "aperiodic": PROFILE,
        },
        lambda x, v: (
            0.034 * math.sin(2 * math.pi * x / 0.05 + 0.3)
            + 0.039 * math.sin(4 * math.pi * x / 0.05 + 1.1)
            + 0.142 * math.sin(12 * math.pi * x / 0.05)
            + spline(x)
        ),
    ),
    "stribeck": (
        {"force_v": 0.06, "velocity_m_s": 0.008, "exponent": 1.5},
        lambda x, v: -0.06 * math.exp(-((abs(v) / 0.008) ** 1.5)) * sf(v),
    ),
    "asymmetric_friction": (
        {"coulomb_v": 0.03, "viscous_v_s_m": 0.2},
        lambda x, v: -0.03 * abs(sf(v)) - 0.2 * abs(v),
    ),
    "position_dependent_friction": (
        {"center_m": 0.1, "linear_v_m": 0.2, "quadratic_v_m2": 0.5, "profile": PROFILE},
        lambda x, v: -(0.2 * (x - 0.1) + 0.5 * (x - 0.1) ** 2 + spline(x)) * sf(v),
    ),
    "position_force": (
        {
            "center_m": 0.1,
            "spring_v_m": 0.7,
            "cubic_v_m3": 3.0,
            "profile": PROFILE,
            "end_effect": {"force_v": 0.3, "length_m": 0.1},
        },
        lambda x, v: (
            -0.7 * (x - 0.1)
            - 3.0 * (x - 0.1) ** 3
            + spline(x)
            + 0.3 * (math.exp(-(x + 0.5) / 0.1) - math.exp(-(0.5 - x) / 0.1))
        ),
    ),
    "quadratic_drag": ({"drag_v_s2_m2": 0.4}, lambda x, v: -0.4 * v * abs(v)),
    "friction_patch": (
        {"force_v": 0.08, "position_m": 0.1, "width_m": 0.05, "velocity_m_s": 0.2},
        lambda x, v: -0.08 * gauss((x - 0.1) / 0.05) * gauss(v / 0.2) * sf(v),
    ),
    "friction_bump": (
        {"force_v": 0.07, "velocity_m_s": 0.3, "width_m_s": 0.1},
        lambda x, v: -0.07 * gauss((abs(v) - 0.3) / 0.1) * sf(v),
    ),
}


@pytest.mark.parametrize("name", FORMULAS)
@settings(max_examples=25)
@given(x=st.floats(-0.4, 0.4), v=st.floats(-1.0, 1.0))
def test_an_effect_adds_the_force_of_its_formula(name, x, v):
    options, formula = FORMULAS[name]
    plant = {"travel_m": [-0.5, 0.5], "coulomb_friction_v": COULOMB}
    without = force_at(x, v, **plant)
    added = force_at(x, v, **plant, **{name: options}) - without
    assert added == pytest.approx(formula(x, v), abs=2e-7)


@settings(max_examples=25)
@given(v=st.floats(-1.0, 1.0))
def test_the_declared_friction_is_viscous_plus_smooth_coulomb(v):
    force = force_at(0.0, v, viscous_friction_v_s_m=0.3, coulomb_friction_v=COULOMB)
    assert force == pytest.approx(-0.3 * v - COULOMB * sf(v), abs=1e-8)


@pytest.mark.parametrize("kind", ["dahl", "lugre"])
def test_sliding_presliding_friction_reaches_the_coulomb_level_and_stribeck_raises_it(kind):
    plant = {
        "coulomb_friction_v": COULOMB,
        "presliding": {"kind": kind, "displacement_m": 1e-5},
        "stribeck": {"force_v": 0.05, "velocity_m_s": 0.01},
    }
    slow = force_at(0.0, 0.01, periods=2000, **plant)
    assert slow == pytest.approx(-COULOMB - 0.05 * math.exp(-1.0), rel=1e-6)
    assert force_at(0.0, 0.1, periods=200, **plant) == pytest.approx(-COULOMB, rel=1e-6)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_dahl_friction_builds_up_exponentially_over_the_way(sign):
    plant = {"coulomb_friction_v": COULOMB, "presliding": {"displacement_m": 1e-4}}
    v, periods = sign * 0.1, 50
    way = abs(v) * 20e-6 * (periods - 0.5)
    force = force_at(0.0, v, periods=periods, **plant)
    assert force == pytest.approx(-sign * COULOMB * (1 - math.exp(-way / 1e-4)), rel=1e-9)


def test_a_cable_pulls_back_with_hysteresis_over_its_length():
    plant = {"position_force": {"cable": {"force_v": 0.2, "length_m": 0.01}}}
    v, periods = 0.5, 1000
    way = v * 20e-6 * (periods - 0.5)
    force = force_at(0.0, v, periods=periods, **plant)
    assert force == pytest.approx(-0.2 * (1 - math.exp(-way / 0.01)), rel=1e-9)


def test_a_periodic_disturbance_integrates_to_its_sine():
    disturbance = {"amplitude_v": 0.3, "frequency_hz": 46.0, "phase_rad": 0.7}
    motion = Bench(bare(periodic_disturbance=disturbance)).run(0.0, 1000)
    w, t = 2 * math.pi * 46.0, motion.time_s
    exact = 0.3 / 0.2 / w * (math.cos(0.7) - np.cos(w * t + 0.7))
    assert motion.velocity_m_s[:, 0] == pytest.approx(exact, abs=2e-8)


def test_force_noise_is_white_and_has_its_rms():
    motion = Bench(bare(force_noise_rms_v=0.01), seed=3).run(0.0, 20000)
    force = motion.acceleration_m_s2[1:, 0] * 0.2
    assert force.std() == pytest.approx(0.01, rel=0.03)
    assert abs(force.mean()) < 4 * 0.01 / math.sqrt(20000)
    assert abs(np.corrcoef(force[:-1], force[1:])[0, 1]) < 0.03
    assert (np.abs(force) > 0.02).mean() == pytest.approx(0.0455, abs=0.006)  # normal


def test_a_wandering_force_is_exponentially_correlated():
    wandering = {"rms_v": 0.05, "time_constant_s": 0.01}
    motion = Bench(bare(wandering_force=wandering), seed=4).run(0.0, 40000)
    force = motion.acceleration_m_s2[1:, 0] * 0.2
    assert force.std() == pytest.approx(0.05, rel=0.1)
    decay = math.exp(-0.2e-3 / 0.01)
    assert np.corrcoef(force[:-1], force[1:])[0, 1] == pytest.approx(decay, abs=3e-3)
    driving = lfilter([1.0, -decay], [1.0], force)[1:]
    assert abs(np.corrcoef(driving[:-1], driving[1:])[0, 1]) < 0.02


def test_effects_add_up():
    both = {name: FORMULAS[name][0] for name in ("cogging", "position_force", "quadratic_drag")}
    travel = {"travel_m": [-0.5, 0.5]}
    together = force_at(0.12, 0.4, **travel, **both)
    assert together == pytest.approx(sum(FORMULAS[n][1](0.12, 0.4) for n in both), abs=3e-7)
