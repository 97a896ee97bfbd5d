"""A slow motion whose acceleration drowns in the encoder's noise: its sign is told all the same."""

import numpy as np
import pytest
from fit_plant import C1

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.verdict.recording_mistakes import check_explains

RATE_HZ = 50.0
NOISE_RAD = 0.05 * np.pi / 180.0


def slow_sweep(sign, noise=NOISE_RAD, command=None):
    """Return an axis that swings by 25 degrees, ever faster up to 0.3 Hz."""
    random = np.random.default_rng(2)
    time_s = np.arange(round(60.0 * RATE_HZ)) / RATE_HZ
    x = np.deg2rad(12.5) * np.sin(2.0 * np.pi * (0.05 + 0.002 * time_s) * time_s)
    v = np.gradient(x, 1.0 / RATE_HZ)
    torque = 0.02 * np.gradient(v, 1.0 / RATE_HZ) + 0.4 * v + 0.1 * np.tanh(v / 0.01)
    torque += 0.02 * random.standard_normal(len(x))
    return Measured(
        source="a sweep", axis="arm", sample_rate_hz=RATE_HZ, time_s=time_s,
        position=x + noise * random.standard_normal(len(x)),
        command=sign * torque if command is None else command,
        usable=np.ones(len(x), dtype=bool), position_unit="rad", command_unit="N*m",
    )  # fmt: skip


def refusal(data):
    with pytest.raises(DataError) as refused:
        check_explains(data, make_signals(data, slope_s_m=900.0), C1)
    return str(refused.value)


def test_a_reversed_sign_is_told_of_a_motion_too_slow_for_its_noise():
    told = refusal(slow_sweep(-1.0, 4.0 * NOISE_RAD))
    assert "the sign of one of the two is reversed" in told


def test_a_right_sign_is_not_called_reversed_and_the_noise_is_told():
    assert "only noise" in refusal(slow_sweep(1.0, 4.0 * NOISE_RAD))


def test_a_command_that_has_nothing_to_do_with_the_motion_is_not_called_reversed():
    random = np.random.default_rng(7)
    slow = np.convolve(random.standard_normal(3000), np.ones(50) / 50.0, "same")
    assert "only noise" in refusal(slow_sweep(1.0, 4.0 * NOISE_RAD, command=slow))
