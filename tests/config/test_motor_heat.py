"""How hot a program makes a motor: as running the model tick by tick over all of it shows."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.config import motor_heat
from motorctl.config.motor_heat import heat_kept, hottest_v, warmed

TS = 1e-3


def hottest_tick_by_tick(volts, cycles, time_constant_s):
    heat_v2, most_v2 = 0.0, 0.0
    for volt in [*volts] * cycles:
        heat_v2 = warmed(heat_v2, volt, heat_kept(time_constant_s, TS))
        most_v2 = max(most_v2, heat_v2)
    return math.sqrt(most_v2)


def within(volts):
    """Return the command of a cycle as a function of time."""
    return lambda t: np.asarray(volts)[np.round(t / TS).astype(int)]


@given(
    st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=40),
    st.integers(1, 30),
    st.floats(-3.0, 5.0).map(lambda x: 10.0**x),
)
def test_the_hottest_tick_of_all_cycles_is_found_in_the_last_one(volts, cycles, time_constant_s):
    found_v = hottest_v(within(volts), len(volts) * TS, cycles, time_constant_s, TS)
    true_v = hottest_tick_by_tick(volts, cycles, time_constant_s)
    assert found_v == pytest.approx(true_v, rel=1e-6, abs=1e-9)


def test_a_constant_command_warms_a_motor_to_itself():
    assert hottest_v(np.ones_like, 100.0, 1, 2.0, TS) == pytest.approx(1.0)


def test_a_cycle_of_more_ticks_than_are_looked_at_is_looked_at_more_coarsely(monkeypatch):
    def swing(t):
        return 3.0 * np.sin(2.0 * np.pi * t)

    fine_v = hottest_v(swing, 4.0, 1, 0.2, TS)
    monkeypatch.setattr(motor_heat, "MOST_STEPS", 400)
    assert hottest_v(swing, 4.0, 1, 0.2, TS) == pytest.approx(fine_v, rel=0.02)
