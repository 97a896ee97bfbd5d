"""An axis whose effect is declared follows as one that has no such effect."""

from __future__ import annotations

from functools import cache
from math import cos, sin

import pytest
from compensation_bench import EVERY, FEW, Tracking, machine, track

# Effect: what the plant has; what is declared.
CASES = {
    "cogging": (
        {
            "pitch_m": 0.05,
            "harmonics": [
                {"order": 1, "amplitude_v": 0.3, "phase_rad": 0.4},
                {"order": 2, "amplitude_v": 0.1},
            ],
        },
        {"sin_1": 0.3 * cos(0.4), "cos_1": 0.3 * sin(0.4), "sin_2": 0.1},
    ),
    "force_ripple": (
        {"pitch_m": 0.06, "harmonics": [{"order": 1, "amplitude": 0.08, "phase_rad": 0.4}]},
        {"sin_1": 0.08 * cos(0.4), "cos_1": 0.08 * sin(0.4)},
    ),
    "stribeck": ({"force_v": 0.1, "velocity_m_s": 0.01}, {"": 0.1}),
    "asymmetric_friction": (
        {"coulomb_v": 0.1, "viscous_v_s_m": 0.1},
        {"coulomb": 0.1, "viscous": 0.1},
    ),
    "presliding": ({"displacement_m": 20e-6}, {"force": 0.139}),
    "position_dependent_friction": (
        {"center_m": 0.05, "linear_v_m": 1.5, "quadratic_v_m2": 10.0},
        {"linear": 1.5, "quadratic": 10.0},
    ),
    "position_force": (
        {"center_m": 0.05, "spring_v_m": 5.0, "cubic_v_m3": 500.0},
        {"spring": 5.0, "cubic": 500.0},
    ),
    "quadratic_drag": ({"drag_v_s2_m2": 1.0}, {"": 1.0}),
    "dead_zone": ({"half_width_v": 0.1}, {"depth": 0.09}),
    "gain_drift": ({"fraction": 0.15, "time_constant_s": 1.0}, {"fraction": 0.15}),
    "payload_change": ({"time_s": 1.1, "inertia_v_s2_m": 0.05}, {"": 0.05}),
    "cross_axis": (
        {"channel": 1, "acceleration_v_s2_m": 0.04, "velocity_v_s_m": 0.2},
        {"acceleration_y": 0.04, "velocity_y": 0.2},
    ),
    "flexible_mode": (
        {"frequency_hz": 45.0, "damping_ratio": 0.02, "fraction": 0.2},
        {"inertia": 0.2 * 0.197},
    ),
    "periodic_disturbance": (
        {"amplitude_v": 0.2, "frequency_hz": 23.0, "phase_rad": 0.3},
        {"sin": 0.2 * cos(0.3), "cos": 0.2 * sin(0.3)},
    ),
}

LAWS = {"few": FEW, "every": EVERY}
"""What the law knows beside the effect."""


@cache
def oracle(known: str) -> Tracking:
    """The machine that has none of them."""
    return track(machine({}, {}, known=LAWS[known]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "known"),
    [
        *((name, "few") for name in CASES if name in FEW),
        *(pytest.param(name, "every", marks=pytest.mark.long) for name in CASES),
    ],
)
def test_declaring_an_effect_takes_away_what_it_adds_to_the_error(name: str, known: str) -> None:
    plant, estimates = CASES[name]
    nothing, law = oracle(known).rms_um, LAWS[known]
    undeclared = track(machine({name: plant}, {}, known=law)).rms_um - nothing
    declared = track(machine({name: plant}, {name: estimates}, known=law)).rms_um - nothing
    assert nothing < 0.15  # a count is 0.5 um
    assert undeclared > 0.1
    assert declared < 0.15 * undeclared
