"""Resonances that are none: smoothed noise, a single sine, a command that was told late."""

from __future__ import annotations

import re
from dataclasses import replace
from math import tanh

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant
from scipy.signal import lfilter

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.late_column import as_late_column
from motorctl.identify.diagnose.search.uncommanded import uncommanded
from motorctl.identify.diagnose.verdict import verdict
from motorctl.model import effect_class, make_effect

RATE_HZ = 100.0
DURATION_S = 40.0
SUBSTEPS = 20
INERTIA, VISCOUS, FRICTION = 0.245, 0.21, 2.0
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
        told[row], driven = speed, float(command[row])
        for _ in range(SUBSTEPS):
            force = driven - VISCOUS * speed - FRICTION * tanh(speed / 0.5)
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


def with_mode(data: Measured, frequency_hz: float, damping_ratio: float = 0.1) -> Hypothesis:
    signals = make_signals(data, slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    mode = make_effect(
        effect_class("flexible_mode"),
        {"frequency_hz": frequency_hz, "damping_ratio": damping_ratio},
    )
    return Hypothesis(Regressors(signals, C1, blocks, "command")).plus(mode).refreshed()


def test_a_resonance_that_only_smooths_noise_is_refuted_with_what_the_command_lacks():
    refuted = uncommanded(with_mode(clean_wheel(), 2.3))
    assert refuted is not None
    assert "above 2.07 Hz the command has" in refuted[1]


def test_one_sine_shows_no_resonance_on_itself():
    assert uncommanded(with_mode(clean_wheel(((2.2, 30.0),)), 2.2)) is not None


def test_one_sine_with_a_little_of_others_shows_no_resonance_near_it():
    nearly = with_mode(clean_wheel(((3.0, 60.0), (7.1, 2.0))), 2.75)
    refuted = uncommanded(nearly)
    assert refuted is not None
    assert "beside a sine of 3 Hz, the command's strongest" in refuted[1]


@pytest.mark.slow
def test_a_command_that_is_one_perfect_sine_is_diagnosed():
    found = diagnose_axis(clean_wheel(((3.0, 60.0),)), C1)
    assert found.effects == ()


def recorded_late(data: Measured, smoothed_s: float, late_s: float) -> Measured:
    """Return a recording whose command column was filtered, or written down too late."""
    left = np.exp(-1.0 / (smoothed_s * data.sample_rate_hz)) if smoothed_s else 0.0
    told, _ = lfilter([1.0 - left], [1.0, -left], data.command, zi=left * data.command[:1])
    samples = round(late_s * data.sample_rate_hz)
    return replace(data, command=np.concatenate([np.full(samples, told[0]), told])[: len(told)])


LIVELY = OtherPlant(bandwidth_hz=5.0)
SPRUNG = OtherPlant(load=0.4, load_hz=15.0, bandwidth_hz=5.0)


@pytest.mark.parametrize(("smoothed_s", "late_s"), [(0.01, 0.0), (0.0, 0.005)])
def test_a_command_that_was_recorded_late_is_no_spring(smoothed_s, late_s):
    data = recorded_late(LIVELY.run(seed=5, duration_s=8.0), smoothed_s, late_s)
    late = with_mode(data, 5.0, 0.4)
    assert late.held_out < 0.8 * late.without("flexible_mode").held_out
    refuted = as_late_column(late)
    assert refuted is not None
    assert "Record the command as it was sent" in refuted[1]


def test_a_spring_is_no_late_column():
    assert as_late_column(with_mode(SPRUNG.run(seed=5, duration_s=8.0), 15.0)) is None


DRY = OtherPlant(
    inertia=0.1, coulomb=1.0, shape="arctan", width_m_s=1.0 / 900.0, peak_acceleration=3.0,
    bandwidth_hz=5.0,
)  # fmt: skip


def with_bristles(data: Measured, displacement_m: float) -> Hypothesis:
    signals = make_signals(data, slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    bristles = make_effect(effect_class("presliding"), {"displacement_m": displacement_m})
    return Hypothesis(Regressors(signals, C1, blocks, "command")).plus(bristles).refreshed()


def test_a_command_that_was_recorded_late_is_no_bristles():
    late = with_bristles(recorded_late(DRY.run(seed=5, duration_s=8.0), 0.0, 0.02), 3e-4)
    assert late.held_out < 0.6 * late.without("presliding").held_out
    refuted = as_late_column(late)
    assert refuted is not None
    told = re.search(r"answers to the command (\S+) ms before it was recorded", refuted[1])
    assert told is not None
    assert float(told[1]) == pytest.approx(20.0, abs=3.0)


def test_bristles_are_no_late_column():
    data = LIVELY.run(seed=5, duration_s=8.0)
    bent = with_bristles(data, 1e-3)
    signals = bent.regressors.signals
    (stretch,) = signals.stretches
    force = stretch.columns(bent.added[0])[0]
    pushed = np.interp(data.time_s, stretch.time_s, 0.3 * force)
    there = with_bristles(replace(data, command=data.command + pushed), 1e-3)
    assert there.held_out < 0.2 * there.without("presliding").held_out
    assert as_late_column(there) is None


def test_a_load_that_swings_where_the_command_is_stays():
    assert uncommanded(with_mode(SPRUNG.run(seed=5, duration_s=8.0), 15.0)) is None


def test_bursts_are_told_below_a_frequency_that_the_recording_has():
    fine = clean_wheel()
    slow = replace(
        fine, sample_rate_hz=RATE_HZ / 5, time_s=fine.time_s[::5], position=fine.position[::5],
        command=fine.command[::5], usable=fine.usable[::5],
    )  # fmt: skip

    class Outcome:
        final = with_mode(slow, 2.3)

    assert 1.0 < verdict.burst_hz(Outcome()) < 10.0
