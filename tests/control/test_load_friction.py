"""Friction that grows with the motor's force: the law inverts it, and learns how much it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from law_stepper import Stepper, known

from motorctl.model import EffectList

TS = 0.2e-3
MU, INERTIA, STEEP_S_M = 0.2, 0.2, 400.0
LOW, HIGH = (0.05, 0.0), (0.5, 0.6)
MODEL = EffectList([known("inertia"), known("load_friction", slope_s_m=STEEP_S_M)])


def motion(t: float) -> tuple[float, float, float]:
    """A reference with many reversals; at rest at the start."""
    parts = [(1.3, 0.03), (3.1, 0.006)]
    x = sum(s * (1.0 - math.cos(2 * math.pi * f * t)) for f, s in parts)
    v = sum(s * 2 * math.pi * f * math.sin(2 * math.pi * f * t) for f, s in parts)
    a = sum(s * (2 * math.pi * f) ** 2 * math.cos(2 * math.pi * f * t) for f, s in parts)
    return x, v, a


class Plant:
    """A mass behind a screw that loses a part of what goes through it."""

    def __init__(self) -> None:
        self.x, self.v = 0.0, 0.0

    def pass_period(self, u: float, parts: int = 20) -> None:
        h = TS / parts
        for _ in range(parts):
            lost = MU * abs(u) * 2.0 / math.pi * math.atan(STEEP_S_M * self.v)
            a = (u - lost) / INERTIA
            self.x += h * self.v + 0.5 * h * h * a
            self.v += h * a


def followed(theta: tuple[float, float], **settings: object) -> tuple[float, Stepper]:
    """Return the rms following error [m] of a second, and the law."""
    law, plant = Stepper(MODEL, theta, LOW, HIGH, **settings), Plant()
    law.start(0.0, 0.0)
    errors = []
    for k in range(5000):
        errors.append(plant.x - motion(k * TS)[0])
        plant.pass_period(law.step(k * TS, plant.x, motion(k * TS)))
    return float(np.sqrt(np.mean(np.square(errors)))), law


@pytest.mark.slow
def test_declaring_it_takes_away_what_it_adds_to_the_error() -> None:
    without, _ = followed((INERTIA, 0.0), enabled=False)
    declared, _ = followed((INERTIA, MU), enabled=False)
    assert declared < 0.15 * without


@pytest.mark.slow
def test_the_part_that_is_lost_is_learned() -> None:
    _, law = followed((0.15, 0.0))
    inertia, mu = law.record["theta"][:2]
    assert inertia == pytest.approx(INERTIA, rel=0.01)
    assert mu == pytest.approx(MU, rel=0.03)


@pytest.mark.parametrize("v", [-1.0, -1e-3, 0.0, 1e-3, 1.0])
@pytest.mark.parametrize("u", [-7.0, -0.1, 0.0, 0.1, 7.0])
def test_it_takes_energy_and_never_gives_any(u: float, v: float) -> None:
    theta = np.array([INERTIA, MU])
    force = MODEL.kernels.input_map(u, 0.0, v, 0.0, np.zeros(0), theta) - u
    assert force * v <= 0.0
    assert abs(force) <= MU * abs(u)
