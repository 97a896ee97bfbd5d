"""A drive stage with hysteresis: the law inverts it, and learns it, from what really acted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from changed_toys import toy_effect
from law_stepper import Stepper, known

from motorctl.control import monotonicity_half_planes
from motorctl.errors import UsageError
from motorctl.model import EffectList, effect_class, make_effect

TS = 0.2e-3
PLAY_V, SHARE, INERTIA = 0.8, 0.4, 0.2
LOW, HIGH = (0.05, -0.6), (0.5, 0.6)
HYSTERESIS = make_effect(effect_class("drive_hysteresis"), {"play_v": PLAY_V})
MODEL = EffectList([known("inertia"), HYSTERESIS])


def play(u: float, before: float) -> float:
    """The play operator once more."""
    return max(u - PLAY_V, min(u + PLAY_V, before))


def acting(u: float, before: float) -> float:
    return u - SHARE * (u - play(u, before))


def motion(t: float) -> tuple[float, float, float]:
    """A reference with many reversals; at rest at the start."""
    parts = [(1.7, 0.02), (4.1, 0.004), (9.3, 0.0008)]
    x = sum(s * (1.0 - math.cos(2 * math.pi * f * t)) for f, s in parts)
    v = sum(s * 2 * math.pi * f * math.sin(2 * math.pi * f * t) for f, s in parts)
    a = sum(s * (2 * math.pi * f) ** 2 * math.cos(2 * math.pi * f * t) for f, s in parts)
    return x, v, a


class Plant:
    """A mass behind a drive stage with hysteresis, and a lag before it."""

    def __init__(self, lag_s: float = 0.0) -> None:
        self.x, self.v, self.play, self.current, self.lag_s = 0.0, 0.0, 0.0, 0.0, lag_s

    def pass_period(self, u: float, parts: int = 20) -> None:
        h = TS / parts
        for _ in range(parts):
            acts = u
            if self.lag_s:
                self.current += (u - self.current) * -math.expm1(-h / self.lag_s)
                acts = self.current
            self.play = play(acts, self.play)
            force = acts - SHARE * (acts - self.play)
            a = force / INERTIA
            self.x += h * self.v + 0.5 * h * h * a
            self.v += h * a


def stepper(model: EffectList = MODEL, theta=(INERTIA, SHARE), **settings) -> Stepper:
    return Stepper(model, theta, LOW, HIGH, **settings)


@pytest.mark.slow
def test_the_command_is_inverted_from_the_memory_after_the_last_one() -> None:
    law, plant, before, reversals = stepper(enabled=False), Plant(), 0.0, 0
    law.start(0.0, 0.0)
    for k in range(3000):
        u = law.step(k * TS, plant.x, motion(k * TS))
        assert law.record["v"] == pytest.approx(acting(u, before), abs=1e-9)
        reversals += (play(u, before) - before) * u < 0.0
        before = play(u, before)
        plant.pass_period(u)
    assert reversals > 10
    # The model is the plant's, so what is left is the hold's own error.
    assert abs(plant.x - motion(3000 * TS)[0]) < 2e-5


@pytest.mark.slow
def test_the_memory_follows_the_saturated_command() -> None:
    law = stepper(enabled=False)
    law.start(0.0, 0.0)
    assert law.step(0.0, 1.0, (0.0, 0.0, 0.0)) == -10.0
    assert law.record["context"].tolist() == [-PLAY_V, -10.0]


@pytest.mark.slow
def test_a_start_forgets_what_acted_before_and_begins_without_a_bump() -> None:
    law = stepper(enabled=False)
    law.start(0.0, 0.0)
    law.step(0.0, 1.0, (0.0, 0.0, 0.0))
    law.start(TS, 0.3)
    assert not law.record["context"].any()
    assert law.step(2 * TS, 0.3, (0.3, 0.0, 0.0)) == 0.0


@pytest.mark.slow
def test_new_coordinates_leave_the_memory_of_the_drive_as_it_is() -> None:
    creep = toy_effect("cable_creep", relaxation_s=0.1)
    model = EffectList([known("inertia"), HYSTERESIS, creep])
    law = Stepper(model, (INERTIA, SHARE, 1.0), (*LOW, -9.0), (*HIGH, 9.0), enabled=False)
    law.start(0.0, 0.0)
    for k in range(200):
        law.step(k * TS, 1e-3, motion(k * TS))
    held = law.record["context"][creep.memory_size :].copy()
    assert held.any()
    assert law.record["context"][0] != 0.0
    law.shift(200 * TS, 1e-3, 0.5)
    assert (law.record["context"][creep.memory_size :] == held).all()
    assert law.record["context"][0] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("lag_s", [0.0, 0.6e-3])
def test_the_share_of_the_hysteresis_is_learned(lag_s: float) -> None:
    effects = [known("inertia"), HYSTERESIS]
    if lag_s:
        effects.append(known("input_lag", time_s=lag_s))
    law, plant = stepper(EffectList(effects), (0.15, 0.0)), Plant(lag_s)
    law.start(0.0, 0.0)
    for k in range(6000):
        near, far = motion(k * TS), motion((k + 1) * TS)
        plant.pass_period(law.step(k * TS, plant.x, near, near, far))
    inertia, share = law.record["theta"][:2]
    assert inertia == pytest.approx(INERTIA, rel=0.01)
    assert share == pytest.approx(SHARE, rel=0.03)


def test_the_map_keeps_its_inverse_from_every_memory_that_the_effect_names() -> None:
    low, high = np.array([0.05, -0.5]), np.array([0.5, 0.9])
    normals, _ = monotonicity_half_planes(MODEL, low, high, 10.0, 0.05)
    assert len(normals) == 0
    with pytest.raises(UsageError, match="vary with place, time or the past"):
        monotonicity_half_planes(MODEL, low, np.array([0.5, 0.97]), 10.0, 0.05)


def test_a_memory_of_the_wrong_size_is_told() -> None:
    class Wrong(type(HYSTERESIS)):  # type: ignore[misc]
        def memories(self):  # type: ignore[no-untyped-def]
            return [(0.0, 0.0, 0.0)]

    Wrong.__module__ = type(HYSTERESIS).__module__
    model = EffectList([known("inertia"), Wrong(HYSTERESIS.options)])
    with pytest.raises(UsageError, match="'drive_hysteresis': memories"):
        monotonicity_half_planes(model, np.array(LOW), np.array(HIGH), 10.0, 0.05)


def test_a_recording_is_read_with_the_memory_that_its_commands_leave() -> None:
    rng = np.random.default_rng(4)
    u = np.cumsum(rng.normal(size=500))
    still = np.zeros(500)
    psi = MODEL.regressor(still, still, still, still, np.arange(500) * TS, u)
    before, expected = 0.0, []
    for value in u:
        before = play(value, before)
        expected.append(value - before)
    assert psi[:, 1] == pytest.approx(np.array(expected), abs=1e-12)
