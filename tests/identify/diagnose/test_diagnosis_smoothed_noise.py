"""A slow, clean command on a machine whose speed is measured with noise: nothing is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.uncommanded import uncommanded
from motorctl.identify.diagnose.verdict import verdict
from motorctl.model import effect_class, make_effect

RATE_HZ = 100.0
DURATION_S = 40.0
SUBSTEPS = 20
INERTIA, VISCOUS, DRY = 0.245, 0.21, 2.0
"""Of a wheel on a motor [% s^2/rad], [% s/rad], [%]."""
NOISE_RAD_S = 1.0
SINES = ((0.05, 13.0), (0.15, 13.0), (0.475, 22.0), (0.025, 9.0), (0.175, 7.0))
"""The command: frequencies [Hz] and amplitudes [%]."""


def clean_wheel(sines=SINES) -> Measured:
    """Return a wheel that has inertia and friction, sent sines, behind a noisy tachometer."""
    rows = round(DURATION_S * RATE_HZ)
    time_s = np.arange(rows) / RATE_HZ
    command = sum(
        size * np.sin(2.0 * np.pi * hz * time_s + k) for k, (hz, size) in enumerate(sines)
    )
    speed, told, step_s = 0.0, np.zeros(rows), 1.0 / (RATE_HZ * SUBSTEPS)
    for row in range(rows):
        told[row] = speed
        for _ in range(SUBSTEPS):
            force = command[row] - VISCOUS * speed - DRY * np.tanh(speed / 0.5)
            speed += step_s * force / INERTIA
    told += NOISE_RAD_S * np.random.default_rng(1).standard_normal(rows)
    position = np.concatenate([[0.0], np.cumsum(0.5 * (told[1:] + told[:-1])) / RATE_HZ])
    return Measured(
        source="wheel.csv", axis="x", sample_rate_hz=RATE_HZ, time_s=time_s, position=position,
        command=np.asarray(command), usable=np.ones(rows, dtype=np.bool_), position_unit="rad",
        command_unit="%",
    )  # fmt: skip


@pytest.mark.slow
def test_noise_of_the_speed_is_no_spring():
    found = diagnose_axis(clean_wheel(), C1)
    assert [effect.name for effect in found.effects] == [], found.sentence


def with_mode(data: Measured, frequency_hz: float) -> Hypothesis:
    signals = make_signals(data, slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    mode = make_effect(
        effect_class("flexible_mode"), {"frequency_hz": frequency_hz, "damping_ratio": 0.1}
    )
    return Hypothesis(Regressors(signals, C1, blocks, "command")).plus(mode).refreshed()


def test_a_resonance_that_only_smooths_noise_is_refuted_with_what_the_command_lacks():
    refuted = uncommanded(with_mode(clean_wheel(), 2.3))
    assert refuted is not None
    assert "above 1.15 Hz the command has" in refuted[1]


def test_one_sine_shows_no_resonance_on_itself():
    assert uncommanded(with_mode(clean_wheel(((2.2, 30.0),)), 2.2)) is not None


def test_a_load_that_swings_where_the_command_is_stays():
    load = OtherPlant(load=0.4, load_hz=15.0, bandwidth_hz=5.0)
    assert uncommanded(with_mode(load.run(seed=5, duration_s=8.0), 15.0)) is None


def test_bursts_are_told_below_a_frequency_that_the_recording_has():
    fine = clean_wheel()
    slow = replace(
        fine, sample_rate_hz=RATE_HZ / 5, time_s=fine.time_s[::5], position=fine.position[::5],
        command=fine.command[::5], usable=fine.usable[::5],
    )  # fmt: skip

    class Outcome:
        final = with_mode(slow, 2.3)

    assert 1.0 < verdict.burst_hz(Outcome()) < 10.0
