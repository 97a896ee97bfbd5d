"""Sorts of machines of the energy generator, and which of them may have which effect."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from motorctl_benchmarks.other_machines.energy.energy_integrator import Axis, Effect


class Family(NamedTuple):
    """Ranges of one sort of machine; pairs are (lowest, highest)."""

    name: str
    unit: str
    commands: tuple[str, ...]
    travel: tuple[float, float]
    cross_s: tuple[float, float]
    """Travel / top speed."""
    rise_s: tuple[float, float]
    """Top speed / top acceleration."""
    mass: tuple[float, float]
    command_peak: tuple[float, float]
    bandwidth_hz: tuple[float, float]
    viscous_share: tuple[float, float]
    """Viscous force at top speed / force of top acceleration."""


FAMILIES = {
    "servo": Family(
        "hobby servo with gears",
        "rad",
        ("V",),
        (1.8, 2.9),
        (0.25, 0.6),
        (0.06, 0.15),
        (3e-4, 8e-3),
        (4.0, 11.0),
        (4.0, 10.0),
        (0.2, 0.7),
    ),
    "joint": Family(
        "brushless joint",
        "rad",
        ("A", "N m"),
        (2.5, 6.0),
        (0.35, 0.9),
        (0.07, 0.2),
        (0.01, 0.6),
        (3.0, 18.0),
        (5.0, 20.0),
        (0.05, 0.4),
    ),
    "coil": Family(
        "voice coil axis",
        "m",
        ("A", "V", "N"),
        (0.03, 0.12),
        (0.15, 0.4),
        (0.03, 0.1),
        (0.15, 1.5),
        (1.0, 6.0),
        (12.0, 45.0),
        (0.03, 0.3),
    ),
    "piezo": Family(
        "ultrasonic piezo stage",
        "m",
        ("V",),
        (0.04, 0.15),
        (0.25, 0.6),
        (0.05, 0.15),
        (0.2, 2.0),
        (5.0, 40.0),
        (8.0, 25.0),
        (0.2, 0.6),
    ),
    "belt": Family(
        "belt drive",
        "m",
        ("A", "N m"),
        (0.4, 1.5),
        (0.5, 1.0),
        (0.1, 0.25),
        (1.0, 12.0),
        (1.5, 8.0),
        (3.0, 10.0),
        (0.1, 0.5),
    ),
    "linear": Family(
        "iron-core linear motor",
        "m",
        ("A", "N"),
        (0.25, 0.9),
        (0.3, 0.7),
        (0.06, 0.18),
        (3.0, 30.0),
        (4.0, 20.0),
        (8.0, 30.0),
        (0.03, 0.25),
    ),
}

MOTORS, GEARS = ("joint", "linear", "belt"), ("servo", "joint", "belt")
WHERE: dict[Effect, tuple[str, ...]] = {
    **dict.fromkeys(
        (Effect.COGGING, Effect.FORCE_RIPPLE, Effect.FLEXIBLE_LOAD, Effect.UNKNOWN_LATE_BRAKE),
        MOTORS,
    ),
    **dict.fromkeys((Effect.LOAD_FRICTION, Effect.BACKLASH_MOTOR, Effect.BACKLASH_LOAD), GEARS),
    **dict.fromkeys((Effect.CURRENT_SATURATION, Effect.EDDY_BRAKE), ("joint", "linear", "coil")),
    Effect.GRAVITY_CONSTANT: ("belt", "linear", "coil", "piezo"),
    Effect.GRAVITY_SINE: ("servo", "joint", "joint"),
    Effect.VOLTAGE_CLIPPING: (*MOTORS, "coil"),
    Effect.PRESLIDING: (*MOTORS, "piezo", "coil"),
    Effect.FLEXIBLE_MOTOR: (*MOTORS, "servo"),
    Effect.HARD_STOP: ("servo", "belt", "linear", "coil"),
    Effect.DRIVE_HYSTERESIS: ("piezo", "piezo", "servo", "coil"),
}
RUBBING = {
    Effect.STRIBECK,
    Effect.ASYMMETRIC_FRICTION,
    Effect.PRESLIDING,
    Effect.WARMING_FRICTION,
    Effect.POSITION_FRICTION,
    Effect.LOAD_FRICTION,
}
"""Effects of friction: there must be some of it."""
LOCAL = {
    Effect.PRESLIDING,
    Effect.BACKLASH_MOTOR,
    Effect.BACKLASH_LOAD,
    Effect.VOLTAGE_CLIPPING,
    Effect.COMMAND_DELAY,
    Effect.COMMAND_LAG,
    Effect.DRIVE_HYSTERESIS,
    Effect.UNKNOWN_TELEGRAM_LOSS,
    Effect.STRIBECK,
    Effect.UNKNOWN_STALE_GREASE,
    Effect.UNKNOWN_LATE_BRAKE,
    Effect.CURRENT_SATURATION,
    Effect.UNKNOWN_RELAXING_DAMPER,
}
"""Effects that act for a part of the time: their share of the whole command stays smaller."""
STYLES: dict[Effect, tuple[int, ...]] = {
    **dict.fromkeys(
        (Effect.UNKNOWN_LATE_BRAKE, Effect.UNKNOWN_STALE_GREASE, Effect.ASYMMETRIC_FRICTION), (0, 1)
    ),  # moves and long rests
    **dict.fromkeys((Effect.CURRENT_SATURATION, Effect.VOLTAGE_CLIPPING), (0, 3, 4)),  # brisk ones
}


class Frame(NamedTuple):
    """Measures of the machine without its effect, for drawing the effect."""

    axis: Axis
    travel: float
    """Position runs from -travel / 2 to travel / 2."""
    speed: float
    acceleration: float
    peak: float
    """Force of top acceleration, top speed and friction."""
    period: float
    duration: float
    resolution: float


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a log-uniform number."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
