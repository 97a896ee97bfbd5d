"""Near rest: how slowly an axis turns round, and where it sticks."""

from __future__ import annotations

import numpy as np
import pytest

from motorctl.identify.columns.reversals import slow_reversal
from motorctl.identify.columns.stretches import Stretch, sticks

PERIOD_S = 2e-4
T = np.arange(0.0, 2.0, PERIOD_S)


@pytest.mark.parametrize("acceleration", [0.05, 1.0, 20.0])
def test_the_acceleration_of_a_reversal_is_that_of_the_motion(acceleration):
    x = 0.5 * acceleration * (T - 1.0) ** 2
    assert slow_reversal(x, 1e-6, PERIOD_S) == pytest.approx(acceleration, rel=0.15)


def test_a_motion_one_way_has_no_reversal():
    assert slow_reversal(0.3 * T, 1e-6, PERIOD_S) is None
    assert slow_reversal(np.zeros_like(T), 0.0, PERIOD_S) is None


def dropped(x, noise, margin_s=0.0):
    v = np.gradient(x, PERIOD_S)
    stretch = Stretch(T, x, x, v, np.zeros_like(x), {}, v)
    return sticks(stretch, PERIOD_S, 1, noise, margin_s)


STUCK = np.interp(T, [0.0, 0.9, 1.0, 2.0], [0.0, 0.45, 0.45, 0.95])


@pytest.mark.parametrize("margin_s", [0.0, 0.01])
def test_rows_in_which_an_axis_sticks_are_dropped_and_no_others(margin_s):
    found = dropped(STUCK, 1e-7, margin_s)
    inside = (T > 0.9) & (T < 1.0)
    assert found[inside].all()
    assert found.sum() * PERIOD_S == pytest.approx(0.1 + 2.0 * margin_s, abs=2e-3)


def test_slow_motion_that_the_encoder_shows_is_kept():
    creeping = np.interp(T, [0.0, 0.9, 1.0, 2.0], [0.0, 0.45, 0.4502, 0.95])
    assert not dropped(creeping, 1e-7).any()


def test_an_encoder_too_coarse_to_tell_slow_motion_from_rest_drops_nothing():
    assert not dropped(STUCK, 1e-3).any()
