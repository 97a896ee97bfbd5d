"""An encoder beyond a spring: the load follows the motor below the resonance, and not above."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fit_plant import C1
from scipy.signal import cont2discrete, dlsim

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis

RATE_HZ = 1000.0
DURATION_S = 8.0
MOTOR, LOAD = 2e-3, 3e-3
"""Inertias [N m s^2/rad]."""
VISCOUS = 0.01
"""Of the motor's friction [N m s/rad]."""
RESONANCE_HZ = 40.0


def lines(seed: int, highest_hz: float = 90.0) -> np.ndarray:
    """Return a torque [N m] of sines at every half hertz."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    frequencies = np.arange(1.0, highest_hz, 0.5)
    phases = rng.uniform(0.0, 2.0 * math.pi, len(frequencies))
    sines = np.cos(2.0 * math.pi * np.outer(frequencies, time_s) + phases[:, None])
    return np.asarray(0.1 * sines.sum(axis=0))


def load_on_spring(torque: np.ndarray) -> np.ndarray:
    """Return the angle of the load, behind an encoder of 6 µrad."""
    stiffness = (2.0 * math.pi * RESONANCE_HZ) ** 2 * MOTOR * LOAD / (MOTOR + LOAD)
    loss = 0.02 * stiffness / (2.0 * math.pi * RESONANCE_HZ)
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-stiffness / MOTOR, -(loss + VISCOUS) / MOTOR, stiffness / MOTOR, loss / MOTOR],
            [0.0, 0.0, 0.0, 1.0],
            [stiffness / LOAD, loss / LOAD, -stiffness / LOAD, -loss / LOAD],
        ]
    )
    b = np.array([[0.0], [1.0 / MOTOR], [0.0], [0.0]])
    c = np.array([[0.0, 0.0, 1.0, 0.0]])
    system = cont2discrete((a, b, c, np.zeros((1, 1))), 1.0 / RATE_HZ)
    _, angle, _ = dlsim(system, torque)
    return np.asarray(np.rint(angle[:, 0] / 6e-6) * 6e-6)


def recorded(position: np.ndarray, command: np.ndarray) -> Measured:
    return Measured(
        source="a.csv", axis="x", sample_rate_hz=RATE_HZ,
        time_s=np.arange(len(position)) / RATE_HZ, position=position, command=command,
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
