"""A part that swings slowly and by itself is no force from outside of that frequency."""

from __future__ import annotations

import numpy as np
from fit_plant import C1
from scipy.integrate import solve_ivp

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis

RATE_HZ = 500.0
TIME_S = np.arange(5000) / RATE_HZ
WHEEL, PENDULUM, SWING_HZ, DRAG, COULOMB = 0.034, 0.65, 1.046, 0.003, 0.05


def chirp(time_s):
    """Return a torque that sweeps over the swing, 0.5 to 2 Hz in 10 s."""
    return np.sin(2.0 * np.pi * (0.5 * time_s + 0.075 * time_s**2) + 1.0)


def wheel(fan: float = 0.0, swings: bool = True) -> Measured:
    """Return a wheel on a pendulum, whose encoder turns with the pendulum.

    A fan pushes the wheel at the frequency of the swing, where there is one.
    """

    def moves(time_s, state):
        angle, speed, _, turning = state
        loss = DRAG * turning + COULOMB * np.tanh(turning / 0.05)
        torque = chirp(time_s) - loss + fan * np.sin(2.0 * np.pi * SWING_HZ * time_s)
        weight = PENDULUM * (2.0 * np.pi * SWING_HZ) ** 2 * np.sin(angle)
        carried = (-torque - weight - 0.02 * speed) / PENDULUM if swings else 0.0
        return speed, carried, turning, torque / WHEEL - carried

    run = solve_ivp(
        moves, (0.0, TIME_S[-1]), np.zeros(4), t_eval=TIME_S, rtol=1e-8, atol=1e-9, max_step=0.01
    )
    counts = 4096 / (2.0 * np.pi)
    rng = np.random.default_rng(3)
    command = chirp(TIME_S) + 0.01 * rng.standard_normal(len(TIME_S))
    return Measured(
        source="wheel.csv", axis="x", sample_rate_hz=RATE_HZ, time_s=TIME_S,
        position=np.round(run.y[2] * counts) / counts, command=command,
        usable=np.ones(len(TIME_S), np.bool_), position_unit="rad", command_unit="A",
    )  # fmt: skip


def test_a_pendulum_that_carries_the_axis_is_a_part_on_a_spring():
    axis = diagnose_axis(wheel(), C1)
    assert [effect.name for effect in axis.effects] == ["flexible_mode"]
    options = dict(axis.effects[0].effect.options)
    # Held still, the wheel weighs on the pendulum.
    alone_hz = SWING_HZ / np.sqrt(1.0 + WHEEL / PENDULUM)
    assert abs(options["frequency_hz"] / alone_hz - 1.0) < 0.01
    assert axis.error.held_out_after_rms < 0.3 * axis.error.held_out_before_rms


def test_a_fan_of_the_same_frequency_is_a_force_from_outside():
    axis = diagnose_axis(wheel(fan=0.2, swings=False), C1)
    assert [effect.name for effect in axis.effects] == ["periodic_disturbance"]
