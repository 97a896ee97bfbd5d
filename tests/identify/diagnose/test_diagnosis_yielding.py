"""What sticks to the last micrometre, and what bends before it slides."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.declared_shape import turning_over
from motorctl.identify.diagnose.search.forms import is_corner
from motorctl.identify.diagnose.search.friction_corner import corner_of_friction
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import measure
from motorctl.identify.diagnose.search.search import whitened
from motorctl.identify.diagnose.verdict.yielding import YIELDS, yielding
from motorctl.model import effect_class, make_effect
from motorctl.model.sign_function import Sign

RATE_HZ = 2000.0
COULOMB_V = 0.3
BENDS_M = 2e-5


def axis(bends, seed=3):
    """Return an axis that makes moves with rests, and the command that its forces ask for.

    At rest the command sweeps from the friction before to that after; dry friction holds meanwhile,
    the other has bent when the axis moves on.
    """
    random = np.random.default_rng(seed)
    place, parts, dry = 0.1, [], []
    for _ in range(40):
        way = random.uniform(0.02, 0.08) * (1.0 if place < 0.15 else -1.0)
        s = np.linspace(0.0, 1.0, int(random.uniform(0.2, 0.4) * RATE_HZ))
        parts.append(place + way * (10 * s**3 - 15 * s**4 + 6 * s**5))
        dry.append(np.full(len(s), np.sign(way)))
        place += way
        rest = int(0.1 * RATE_HZ)
        parts.append(np.full(rest, place))
        dry.append(np.full(rest, np.nan))
    x, direction = np.concatenate(parts), np.concatenate(dry)
    known = np.isfinite(direction)
    direction = np.interp(np.arange(len(x)), np.flatnonzero(known), direction[known])
    h = np.zeros(len(x))
    for k in range(1, len(x)):  # Dahl's, along each motion
        moved = x[k] - x[k - 1]
        h[k] = np.sign(moved) + (h[k - 1] - np.sign(moved)) * np.exp(-abs(moved) / BENDS_M)
    v = np.gradient(x, 1.0 / RATE_HZ)
    force = 0.25 * np.gradient(v, 1.0 / RATE_HZ) + 0.3 * v
    force += COULOMB_V * (h if bends else direction)
    plain = OtherPlant().run(seed=1, duration_s=1.0)
    return replace(
        plain,
        sample_rate_hz=RATE_HZ,
        time_s=np.arange(len(x)) / RATE_HZ,
        position=np.round(x / 1e-7) * 1e-7,
        command=force,
        usable=np.ones(len(x), dtype=bool),
        reference=x,
        resolution=1e-7,
    )


BENDING = make_effect(effect_class("presliding"), {"displacement_m": BENDS_M})


def seen(data):
    regressors, _ = whitened(make_signals(data, slope_s_m=900.0), C1, (BENDING,))
    model = turning_over(Hypothesis(regressors, (BENDING,)), Sign(5000.0, "clip"))
    return yielding(model.refreshed(), BENDING)


def test_what_bends_moves_by_its_displacement_while_friction_rises():
    found = seen(axis(bends=True))
    assert found.rises >= 15
    assert 0.7 < found.way_m / found.expected_m < 2.0


def test_what_sticks_does_not_move_while_friction_rises():
    found = seen(axis(bends=False))
    assert found.rises >= 15
    assert found.way_m < YIELDS * found.expected_m


def test_an_axis_that_never_stops_tells_nothing_of_yielding():
    data = OtherPlant().run(seed=1, duration_s=4.0)
    forward = replace(data, position=np.cumsum(np.abs(np.diff(data.position, prepend=0.0))))
    assert seen(forward) is None


def test_rises_of_a_noisy_command_are_no_rises_of_friction():
    """In them no axis moves, and one that bends were taken for one that sticks."""
    data = axis(bends=True)
    noise = np.random.default_rng(1).normal(0.0, 3.0, len(data.command))
    assert seen(replace(data, command=data.command + noise)) is None


@pytest.mark.parametrize(("bends", "displacement_m"), [(True, BENDS_M), (False, 1e-6)])
def test_bending_by_next_to_nothing_explains_dry_friction_and_no_other(bends, displacement_m):
    form = BENDING.with_options(displacement_m=displacement_m)
    regressors, _ = whitened(make_signals(axis(bends), slope_s_m=900.0), C1, (form,))
    hypothesis = Hypothesis(regressors).refreshed()
    assert is_corner(hypothesis, measure(hypothesis, form)) != bends
    beside_dry = form.with_options(slope_s_m=5000.0)
    refuted = corner_of_friction(hypothesis.plus(beside_dry))
    assert (refuted is None) == bends
    if refuted:
        assert refuted[0] == beside_dry
        assert re.search(r"explains \d+ % of what it does .limit 75 %.: .* dry", refuted[1])
    # what turns over slowly may lack a part that is dry
    assert corner_of_friction(hypothesis.plus(form)) is None


def test_the_least_displacement_has_no_corner_below():
    assert BENDING.with_options(displacement_m=1e-12).corner() is None


@pytest.mark.slow
@pytest.mark.parametrize(("bends", "names"), [(True, ["presliding"]), (False, [])])
def test_friction_that_bends_is_named_and_dry_friction_is_not(bends, names):
    found = diagnose_axis(axis(bends), C1)
    assert [effect.name for effect in found.effects] == names, found.sentence
