"""An axis that swings at one frequency: what any bent force leaves at its multiples is no wave."""

from __future__ import annotations

import numpy as np
import pytest
from fit_plant import C1

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.motion_harmonics import swing_hz

RATE_HZ = 500.0


def swinging(frequency_hz, force, duration_s=12.0):
    """Return an axis that swings, with a force [V] of its speed and time beside the usual ones."""
    rng = np.random.default_rng(3)
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    omega = 2.0 * np.pi * frequency_hz
    x = 0.3 / omega * np.sin(omega * time_s)
    v, a = 0.3 * np.cos(omega * time_s), -0.3 * omega * np.sin(omega * time_s)
    command = 0.3 * a + 1.2 * v + 0.4 * np.tanh(v / 2e-3) + 0.1 + force(v / 0.3, time_s)
    command += 0.02 * rng.standard_normal(len(time_s))
    return Measured(
        source="a swing", axis="x", sample_rate_hz=RATE_HZ, time_s=time_s, command=command,
        usable=np.ones(len(time_s), dtype=np.bool_), position=1e-6 * np.rint(x / 1e-6),
        resolution=1e-6,
    )  # fmt: skip


@pytest.mark.parametrize("frequency_hz", [0.7, 1.3, 5.0])
def test_the_frequency_of_a_swing_is_met(frequency_hz):
    data = swinging(frequency_hz, lambda v, t: 0.0 * v)
    assert swing_hz(make_signals(data)) == pytest.approx(frequency_hz, abs=2e-3)


def test_a_motion_of_many_frequencies_is_no_swing():
    data = swinging(1.3, lambda v, t: 0.0 * v)
    other = swinging(2.1, lambda v, t: 0.0 * v)
    both = Measured(**vars(data) | {"position": data.position + 1.6 * other.position})
    assert swing_hz(make_signals(both)) == 0.0


@pytest.mark.slow
def test_friction_that_bends_is_told_as_friction_and_no_disturbance_over_time():
    found = diagnose_axis(swinging(1.3, lambda v, t: 0.5 * v**3), C1)
    assert "periodic_disturbance" not in {effect.name for effect in found.effects}
    assert "of a known kind, friction" in found.sentence


@pytest.mark.slow
def test_a_disturbance_beside_a_swing_is_named():
    beside = swinging(1.3, lambda v, t: 0.3 * np.sin(2.0 * np.pi * 7.3 * t))
    found = {effect.name: effect.effect for effect in diagnose_axis(beside, C1).effects}
    assert found["periodic_disturbance"].lines == pytest.approx([7.3], abs=0.01)
