"""Axes of other trades than motorctl's: a joint with a worm gear, a hose, a cylinder, a rotor.

Each is a differential equation, a loop that leads it along a sum of sines, and an encoder. Nothing
is shared with the model, the simulated gantry or the other plants.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sin, tanh

import numpy as np

from motorctl.identify.columns.measured import Measured

Acceleration = Callable[[float, float, float], float]
"""Of position, velocity and command."""


def sines(
    duration_s: float, rate_hz: float, amplitude: float, band_hz: tuple[float, float], seed: int
) -> np.ndarray:
    """Return a motion of eight sines, (rows, 3): position, velocity, acceleration."""
    random = np.random.default_rng(seed)
    time = np.arange(int(duration_s * rate_hz)) / rate_hz
    frequency = np.exp(random.uniform(*np.log(band_hz), 8))
    w = 2.0 * np.pi * frequency[:, None]
    angle = w * time + random.uniform(0.0, 2.0 * np.pi, 8)[:, None]
    x, v, a = (part.sum(axis=0) for part in (np.sin(angle) / w, np.cos(angle), -w * np.sin(angle)))
    return np.stack([x, v, a], axis=1) * amplitude / np.abs(x).max()


def led(
    moved_by: Acceleration,
    motion: np.ndarray,
    rate_hz: float,
    gains: tuple[float, float],
    ahead: Acceleration,
    resolution: float,
    units: tuple[str, str],
    steps: int = 10,
    most: float = np.inf,
) -> Measured:
    """Lead an axis along a motion and return what is measured.

    Parameters
    ----------
    moved_by
        The axis.
    motion
        Position, velocity and acceleration, (rows, 3).
    rate_hz
        Of the loop and of the recording.
    gains
        On the following error and on its rate.
    ahead
        The command for a position, velocity and acceleration of the motion.
    resolution
        Of the encoder.
    units
        Of position and command.
    steps
        Of the integration in one period.
    most
        Largest command.
    """
    h = 1.0 / rate_hz / steps
    x, v = map(float, motion[0, :2])
    seen, speed = round(x / resolution) * resolution, v
    positions, commands = np.empty(len(motion)), np.empty(len(motion))
    for k, (r, r_dot, r_ddot) in enumerate(motion.tolist()):
        last, seen = seen, round(x / resolution) * resolution
        speed += 0.3 * ((seen - last) * rate_hz - speed) if k else 0.0
        u = gains[0] * (r - seen) + gains[1] * (r_dot - speed) + ahead(r, r_dot, r_ddot)
        u = min(max(u, -most), most)
        positions[k], commands[k] = seen, u
        for _ in range(steps):
            v += h * moved_by(x, v, u)
            x += h * v
    return Measured(
        source="foreign.csv",
        axis="x",
        sample_rate_hz=rate_hz,
        time_s=np.arange(len(motion)) / rate_hz,
        position=positions,
        command=commands,
        reference=motion[:, 0].copy(),
        reference_velocity=None,
        usable=np.ones(len(motion), dtype=bool),
        saturated=None,
        resolution=resolution,
        position_unit=units[0],
        command_unit=units[1],
    )


def worm_joint(loss: float) -> Measured:
    """Return a joint under its weight whose friction grows with what the gear carries."""

    def moved_by(x: float, v: float, u: float) -> float:
        return (u - 4.0 * sin(x) - (0.2 + loss * abs(u)) * tanh(v / 0.02)) / 0.02

    motion = sines(80.0, 200.0, 1.2, (0.1, 1.0), seed=1)
    count = 2.0 * np.pi / 4096
    return led(
        moved_by, motion, 200.0, (20.0, 0.6), lambda x, v, a: 4.0 * sin(x), count,
        ("rad", "N*m"), steps=60,
    )  # fmt: skip


def small_turn(force: Callable[[float], float], turn_rad: float) -> Measured:
    """Return a joint that turns a little to and fro against a force of its angle."""

    def moved_by(x: float, v: float, u: float) -> float:
        return (u - 0.4 * v - tanh(v / 0.02) - force(x)) / 0.15

    motion = sines(20.0, 500.0, turn_rad, (0.1, 1.5), seed=1)
    count = 2.0 * np.pi / 20_000
    return led(
        moved_by, motion, 500.0, (60.0, 3.0), lambda x, v, a: 0.0, count, ("rad", "N*m")
    )  # fmt: skip


def cylinder() -> Measured:
    """Return a hydraulic cylinder: the valve gives it a speed, another one each way."""

    def moved_by(x: float, v: float, u: float) -> float:
        return ((0.05 if u > 0.0 else 0.075) * u - v) / 0.03

    motion = sines(20.0, 500.0, 0.15, (0.1, 1.5), seed=1)
    return led(
        moved_by, motion, 500.0, (100.0, 0.0), lambda x, v, a: v / 0.06, 1e-6, ("m", "V"), most=10.0
    )


def rotor() -> Measured:
    """Return a hovering rotor, whose lift bends over its command."""

    def moved_by(x: float, v: float, u: float) -> float:
        return 0.12 * u + 0.002 * u * u - 9.81 - 0.3 * v

    motion = sines(30.0, 100.0, 1.5, (0.05, 0.8), seed=1)
    return led(
        moved_by, motion, 100.0, (20.0, 12.0), lambda x, v, a: 46.0 + 4.0 * a, 1e-3, ("m", "%")
    )
