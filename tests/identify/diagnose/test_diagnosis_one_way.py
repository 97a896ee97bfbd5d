"""Friction by direction and a constant force, where an axis moves one way."""

from __future__ import annotations

import numpy as np
import pytest
from fit_plant import C1
from scipy.integrate import solve_ivp

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis

RATE_HZ = 500.0
TIME_S = np.arange(5000) / RATE_HZ
INERTIA, VISCOUS, COULOMB, CONSTANT = 0.034, 0.01, 0.05, 0.1


def command(time_s):
    """Return a torque that keeps an axis turning one way for all but its last quarter second."""
    turns = 0.6 + 0.5 * np.sin(2.0 * np.pi * (0.5 * time_s + 0.075 * time_s**2))
    return np.where(time_s > 9.75, -15.0, turns)


def wheel(noise_rad: float) -> Measured:
    """Return a wheel that is caught turning the other way for its first quarter second, too."""

    def moves(time_s, state):
        speed = state[1]
        friction = VISCOUS * speed + COULOMB * np.tanh(speed / 0.05) + CONSTANT
        return speed, (command(time_s) - friction) / INERTIA

    run = solve_ivp(
        moves, (0.0, TIME_S[-1]), (0.0, -10.0), t_eval=TIME_S, rtol=1e-8, atol=1e-9, max_step=0.01
    )
    assert 200 < np.count_nonzero(run.y[1] < 0.0) < 300
    noise = noise_rad * np.random.default_rng(0).standard_normal(len(TIME_S))
    return Measured(
        source="wheel.csv", axis="x", sample_rate_hz=RATE_HZ, time_s=TIME_S,
        position=run.y[0] + noise, command=command(TIME_S),
        usable=np.ones(len(TIME_S), np.bool_), position_unit="rad", command_unit="A",
    )  # fmt: skip


@pytest.mark.parametrize("noise_rad", [5e-3, 2e-2])
def test_turns_that_a_narrow_band_loses_part_no_constant_force_from_friction(noise_rad):
    axis = diagnose_axis(wheel(noise_rad), C1)
    assert "does not separate it from coulomb_friction" in axis.dropped["offset"]
    friction = dict(zip(axis.model.parameter_names, axis.theta, strict=True))["coulomb_friction"]
    assert friction == pytest.approx(COULOMB + CONSTANT, rel=0.1)
