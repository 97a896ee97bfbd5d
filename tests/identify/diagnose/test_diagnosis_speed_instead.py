"""Friction of another shape, where each speed is passed at one time or place only."""

from __future__ import annotations

from dataclasses import replace
from math import atanh, exp, tanh

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import whitened
from motorctl.identify.diagnose.search.speed_instead import speed_instead
from motorctl.model import effect_class, make_effect

RATE_HZ = 100.0
INERTIA, TOP = 0.3, 1.35
STEP_S = 8.0


def wheel(levels, cold=0.0):
    """Return a wheel that runs freely, whose speed bends over the command, and its staircase.

    Cold it has so much more viscous friction, which is gone with a time constant of 100 s.
    """
    u = np.repeat(levels, int(STEP_S * RATE_HZ))
    x, v, inner = np.zeros(len(u)), 0.0, 20
    for k in range(1, len(u)):
        x[k], command = x[k - 1], float(u[k - 1])
        warm = cold * exp(-k / RATE_HZ / 100.0)
        for _ in range(inner):
            bent = 5.0 * atanh(min(max(v / TOP, -0.999), 0.999)) + 0.4 * tanh(v / 0.01)
            v += (command - bent - warm * v) / INERTIA / (RATE_HZ * inner)
            x[k] += v / (RATE_HZ * inner)
    noise = np.random.default_rng(1)
    plain = OtherPlant().run(seed=1, duration_s=1.0)
    return replace(
        plain,
        sample_rate_hz=RATE_HZ,
        time_s=np.arange(len(x)) / RATE_HZ,
        position=np.round(x / 1e-4) * 1e-4,
        command=u + noise.normal(0.0, 0.02, len(u)),
        usable=np.ones(len(x), dtype=bool),
        reference=None,
        resolution=1e-4,
    )


def growing(steps):
    """Return levels of alternating sign, each higher than the last."""
    return [side * level for level in np.linspace(1.0, 12.0, steps) for side in (1.0, -1.0)]


WARMING = make_effect(effect_class("warming_friction"), {"time_constant_s": 100.0})


def refused(data):
    regressors, _ = whitened(make_signals(data, slope_s_m=900.0), C1, (WARMING,))
    return speed_instead(Hypothesis(regressors, (WARMING,)).refreshed())


def test_friction_that_falls_while_speeds_come_again_is_told_from_one_of_speed():
    levels = [side * level for _ in range(6) for level in (3.0, 6.0) for side in (1.0, -1.0)]
    assert refused(wheel(levels, cold=1.0)) is None


@pytest.mark.slow
def test_a_staircase_of_commands_is_not_said_to_warm_up():
    found = diagnose_axis(wheel(growing(12)), C1)
    assert "warming_friction" not in found.sentence
    assert "warming_friction" not in {effect.name for effect in found.effects}
    instead = "warming_friction is refuted: beside a function of speed alone"
    assert any(note.startswith(instead) for note in found.notes)
