"""The band of a diagnosis: that of the motion, or wider where a wave over position shows beyond."""

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.search.motion_band import motion_band_hz
from motorctl.identify.diagnose.verdict.recording_mistakes import check_explains

RESOLUTION_M = 1e-6
TOP_SPEED_M_S = 0.8
PERIOD_M = 0.008
"""Of the encoder's error: 100 Hz at the top speed, where the moves have long ended."""


@pytest.fixture(scope="module")
def slow_loop():
    plant = OtherPlant(
        bandwidth_hz=3.0, peak_velocity=TOP_SPEED_M_S, peak_acceleration=3.0, travel=0.6,
        resolution=RESOLUTION_M,
    )  # fmt: skip
    return plant.run(seed=1, duration_s=12.0)


def band_hz(data):
    """Return the band of the diagnosis, and the widest."""
    signals = make_signals(data, slope_s_m=900.0)
    return motion_band_hz(check_explains(data, signals, C1), signals.band_hz), signals.band_hz


def behind_encoder(data, error_m):
    wrong = data.position + error_m * np.sin(2.0 * np.pi * data.position / PERIOD_M)
    return replace(data, position=np.round(wrong / RESOLUTION_M) * RESOLUTION_M)


def test_a_slow_loop_is_looked_at_in_the_band_of_its_motion(slow_loop):
    found, widest = band_hz(slow_loop)
    assert found < 0.45 * widest


def test_an_encoders_wave_beyond_the_motion_keeps_the_band_in_which_it_shows(slow_loop):
    found, _ = band_hz(behind_encoder(slow_loop, 5e-6))
    assert found > TOP_SPEED_M_S / PERIOD_M


def test_noise_beyond_the_motion_is_no_wave(slow_loop):
    noise = np.random.default_rng(1).normal(0.0, 5e-6, len(slow_loop.position))
    found, widest = band_hz(replace(slow_loop, position=slow_loop.position + noise))
    assert found < 0.45 * widest
