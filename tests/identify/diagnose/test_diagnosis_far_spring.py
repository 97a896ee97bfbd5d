"""An encoder beyond a spring, and one before it whose motor a heavy load holds back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from scipy.signal import cont2discrete, dlsim

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.verdict.far_spring import load_on_spring as hides

RATE_HZ = 1000.0
DURATION_S = 8.0
MOTOR, LOAD = 2e-3, 3e-3
"""Inertias [N m s^2/rad]."""
VISCOUS = 0.01
"""Of the motor's friction [N m s/rad]."""
RESONANCE_HZ = 40.0
SLOW_HZ = 200.0
"""Of the loop that holds a light motor."""
COUNT_RAD = 3e-3
LIGHT = LOAD / 17.0
"""Inertia of a motor that its load outweighs [N m s^2/rad]."""


def lines(seed: int, highest_hz: float = 90.0) -> np.ndarray:
    """Return a torque [N m] of sines at every half hertz."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    frequencies = np.arange(1.0, highest_hz, 0.5)
    phases = rng.uniform(0.0, 2.0 * math.pi, len(frequencies))
    sines = np.cos(2.0 * math.pi * np.outer(frequencies, time_s) + phases[:, None])
    return np.asarray(0.1 * sines.sum(axis=0))


def two_masses(motor: float, hz: float, viscous: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how a motor and its load on a spring of that resonance move by a torque."""
    stiffness = (2.0 * math.pi * hz) ** 2 * motor * LOAD / (motor + LOAD)
    loss = 0.02 * stiffness / (2.0 * math.pi * hz)
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-stiffness / motor, -(loss + viscous) / motor, stiffness / motor, loss / motor],
            [0.0, 0.0, 0.0, 1.0],
            [stiffness / LOAD, loss / LOAD, -stiffness / LOAD, -loss / LOAD],
        ]
    )
    return a, np.array([[0.0], [1.0 / motor], [0.0], [0.0]])


def load_on_spring(torque: np.ndarray) -> np.ndarray:
    """Return the angle of the load, behind an encoder of 6 µrad."""
    a, b = two_masses(MOTOR, RESONANCE_HZ, VISCOUS)
    c = np.array([[0.0, 0.0, 1.0, 0.0]])
    system = cont2discrete((a, b, c, np.zeros((1, 1))), 1.0 / RATE_HZ)
    _, angle, _ = dlsim(system, torque)
    return np.asarray(np.rint(angle[:, 0] / 6e-6) * 6e-6)


def recorded(position: np.ndarray, command: np.ndarray, rate_hz: float = RATE_HZ) -> Measured:
    return Measured(
        source="a.csv", axis="x", sample_rate_hz=rate_hz,
        time_s=np.arange(len(position)) / rate_hz, position=position, command=command,
        usable=np.ones(len(position), dtype=np.bool_), position_unit="rad", command_unit="N*m",
    )  # fmt: skip


@pytest.mark.slow
def test_a_load_on_a_spring_is_judged_below_its_resonance_and_told() -> None:
    torque = lines(1)
    axis = diagnose_axis(recorded(load_on_spring(torque), torque), C1)
    (told,) = [note for note in axis.notes if "through a spring" in note]
    resonance_hz = float(told.partition("a resonance of ")[2].partition(" Hz")[0])
    assert resonance_hz == pytest.approx(RESONANCE_HZ, rel=0.05)
    inertia, viscous = axis.declared_theta[:2]
    assert inertia == pytest.approx(MOTOR + LOAD, rel=0.25)  # the spring gives way by so much
    assert viscous == pytest.approx(VISCOUS, rel=0.25)
    assert [effect.name for effect in axis.effects if effect.confidence > 0.5] == []


@pytest.mark.slow
def test_a_load_on_a_spring_moved_by_another_torque_is_refused() -> None:
    with pytest.raises(DataError, match="the command explains none of the acceleration"):
        diagnose_axis(recorded(load_on_spring(lines(1)), lines(2)), C1)


def held_back(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle of a light motor whose loop holds it against a load, and its torque.

    The load swings at 4 Hz behind a motor that hardly moves then, and at 17 Hz against it.
    """
    system = two_masses(LIGHT, 17.0, 0.002)
    a, b, *_ = cont2discrete((*system, np.eye(4), np.zeros((4, 1))), 1.0 / SLOW_HZ)
    rng = np.random.default_rng(seed)
    state, place, aim, before, next_step = np.zeros(4), 0.0, 0.0, 0.0, 0
    position, torque = [], []
    for k in range(round(10.0 * SLOW_HZ)):
        if k >= next_step:
            place = rng.uniform(-0.25, 0.25)
            next_step = k + int(2.5 * SLOW_HZ * rng.uniform(0.8, 1.2))
        aim += 0.15 * (place - aim)
        position.append(COUNT_RAD * np.rint(state[0] / COUNT_RAD))
        error = aim - position[-1]
        torque.append(0.5 * error + 0.01 * (error - before) * SLOW_HZ)
        before = error
        state = a @ state + b[:, 0] * torque[-1]
    return np.array(position), np.array(torque)


@pytest.mark.slow
def test_a_motor_that_its_load_holds_back_is_known_by_both_masses() -> None:
    angle, torque = held_back(2)
    _, another = held_back(3)
    assert hides(make_signals(recorded(angle, torque, SLOW_HZ)))
    assert not hides(make_signals(recorded(angle, another, SLOW_HZ)))
    assert not hides(make_signals(recorded(angle, -torque, SLOW_HZ)))


def coarse(seed: int) -> Measured:
    return replace(recorded(*held_back(seed), SLOW_HZ), resolution=COUNT_RAD)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 6])
def test_a_load_that_holds_its_motor_back_is_named(seed: int) -> None:
    """It was refused: between antiresonance and resonance the motor moves against its torque."""
    (found,) = diagnose_axis(coarse(seed), C1).effects
    assert found.name == "flexible_mode"
    assert found.confidence > 0.5
    swings_hz = 17.0 * math.sqrt(LIGHT / (LIGHT + LOAD))
    assert found.effect.lines[0] == pytest.approx(swings_hz, rel=0.02)


@pytest.mark.slow
def test_a_load_that_holds_its_motor_back_is_told_where_no_motion_shows_it() -> None:
    """No other name stands for it, and nothing says that the command is another axis'."""
    with pytest.raises(DataError, match="drives this position, but a load on a spring holds"):
        diagnose_axis(coarse(5), C1)
