"""Friction that has just turned round is no friction of the place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.turning_places import shown_by_turning
from motorctl.model import effect_class, make_effect

RATE_HZ = 1000.0
TRAVEL_M = 0.1
MIDDLE_M = 0.2
COULOMB_V = 0.3
BENDS_M = 6e-3
SPRING_V_M = 4.0
KNOTS = (MIDDLE_M - TRAVEL_M / 2, MIDDLE_M + TRAVEL_M / 2, 12)


def to_and_fro(seconds=16.0):
    """Return a sine with nearly the same turning places, as an actuator's test makes it."""
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    return MIDDLE_M + TRAVEL_M / 2 * np.sin(2 * np.pi * 0.5 * t) * (1 - 1e-3 * np.sin(0.7 * t))


def bent(x):
    """Dahl's friction: after a reversal it rises over a part of the travel."""
    h = np.zeros(len(x))
    for k in range(1, len(x)):
        moved = x[k] - x[k - 1]
        h[k] = np.sign(moved) + (h[k - 1] - np.sign(moved)) * np.exp(-abs(moved) / BENDS_M)
    return h


def along_the_way(share):
    """Dry friction that grows along the travel by a share of its mean to each end."""

    def friction(x):
        way = np.tanh(np.gradient(x, 1.0 / RATE_HZ) / 2e-3)
        return way * (1.0 + share * 2.0 * (x - MIDDLE_M) / TRAVEL_M)

    return friction


def axis(friction, seed=3):
    """Return an axis that a spring pulls back, with a friction, and a little noise of its force."""
    x = to_and_fro()
    v = np.gradient(x, 1.0 / RATE_HZ)
    force = 0.25 * np.gradient(v, 1.0 / RATE_HZ) + 0.3 * v + SPRING_V_M * (x - MIDDLE_M)
    force += COULOMB_V * friction(x)
    force += 2e-3 * np.random.default_rng(seed).normal(size=len(x))
    return replace(
        OtherPlant().run(seed=1, duration_s=1.0),
        sample_rate_hz=RATE_HZ,
        time_s=np.arange(len(x)) / RATE_HZ,
        position=x + 1e-9 * np.random.default_rng(seed + 1).normal(size=len(x)),
        command=force,
        usable=np.ones(len(x), dtype=bool),
        reference=None,
        resolution=None,
    )


def with_two_functions_of_the_place(data):
    """Return the model that describes any force of place and direction."""
    effects = tuple(
        make_effect(effect_class(name), {"knots": KNOTS})
        for name in ("position_force", "position_dependent_friction")
    )
    signals = make_signals(data, slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    return Hypothesis(Regressors(signals, C1, blocks, "command"), effects).refreshed()


def test_what_follows_each_reversal_is_no_friction_of_the_place():
    effect, why = shown_by_turning(with_two_functions_of_the_place(axis(bent)))
    assert effect.name == "position_dependent_friction"
    assert "record moves that turn at many places" in why


@pytest.mark.parametrize("share", [0.1, 0.5, -0.8])
def test_friction_that_grows_along_the_way_is_one_wherever_the_axis_turns(share):
    assert shown_by_turning(with_two_functions_of_the_place(axis(along_the_way(share)))) is None
