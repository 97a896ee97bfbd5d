"""What follows from the measured motion itself is no effect: its harmonics, ripple, and inertia."""

from __future__ import annotations

import numpy as np
import pytest
from fit_plant import C1

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.search.gap_in_ripple import gap_in_ripple
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.motions_own_waves import motions_own_wave
from motorctl.identify.diagnose.search.refutation import without_refuted
from motorctl.identify.diagnose.search.search import Found, rival_gains, whitened
from motorctl.identify.diagnose.search.whole_model import inertia_off, seen_inertia
from motorctl.model import effect_class, make_effect

RATE_HZ = 200.0
PROGRAM_HZ = 0.1
"""Of the program that begins anew."""
INERTIA = 0.25
GAP = {"gap_m": 2e-3, "glide_m_s2": 2.0, "contact_hz": 25.0}


def made(name, **options):
    return make_effect(effect_class(name), options or None)


def recording(position, command):
    count = len(position)
    return Measured(
        source="own.csv",
        axis="x",
        sample_rate_hz=RATE_HZ,
        time_s=np.arange(count) / RATE_HZ,
        position=np.round(position / 1e-6) * 1e-6,
        command=command,
        reference=None,
        reference_velocity=None,
        usable=np.ones(count, dtype=bool),
        saturated=None,
        resolution=1e-6,
        position_unit="m",
        command_unit="V",
    )


def driven(position, force=0.0):
    """Return a recording in which the command gives what inertia and friction ask, and a force."""
    v = np.gradient(position, 1.0 / RATE_HZ)
    a = np.gradient(v, 1.0 / RATE_HZ)
    friction = 0.3 * v + 0.1 * np.arctan(900.0 * v)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(len(position))
    return recording(position, INERTIA * a + friction + force + noise)


def outcome(data, *added, side="acceleration", band_hz=None):
    signals = make_signals(data, band_hz, slope_s_m=900.0)
    regressors, noise = whitened(signals, C1, added, side)
    final = Hypothesis(regressors, added).refreshed()
    base = Hypothesis(regressors).refreshed()
    return Found(base, final, (), spans_of(signals), noise, rival_gains(final))


def seconds(duration_s):
    return np.arange(0.0, duration_s, 1.0 / RATE_HZ)


def of_program(t):
    """Return a motion of five harmonics, as those by which arms are identified."""
    sizes = {1: 0.25, 2: 0.04, 3: 0.05, 4: 0.03, 5: 0.05}
    return sum(A * np.sin(2.0 * np.pi * k * PROGRAM_HZ * t + k) for k, A in sizes.items())


@pytest.mark.parametrize("shown", [1.3, 2.5])
def test_a_wave_over_time_is_refuted_that_is_a_harmonic_of_a_motion_that_repeats(shown):
    t = seconds(shown / PROGRAM_HZ)
    line_hz = 5.0 * PROGRAM_HZ
    data = driven(of_program(t), 0.5 * np.sin(2.0 * np.pi * line_hz * t))
    found = outcome(data, made("periodic_disturbance", frequency_hz=line_hz))
    refuted = motions_own_wave(found.final)
    assert refuted is not None
    assert "the motion repeats after 10" in refuted[1]
    assert "5 cycles" in refuted[1]
    kept, why = without_refuted(found)
    assert not kept.final.added
    assert refuted[1] in why


@pytest.mark.parametrize(
    ("position", "line_hz"),
    [
        (of_program, 5.3 * PROGRAM_HZ),
        (lambda t: 0.25 * np.sin(0.5 * t + 0.03 * t**2), 5.0 * PROGRAM_HZ),
        (lambda t: 1e-3 * np.sin(2.0 * np.pi * 3.0 * t), 3.0),
    ],
    ids=["beside the harmonics", "a motion that does not repeat", "what it moves itself"],
)
def test_a_wave_over_time_stands_where_the_motion_is_not_in_step_with_it(position, line_hz):
    t = seconds(25.0)
    data = driven(position(t), 0.5 * np.sin(2.0 * np.pi * line_hz * t + 0.4))
    found = outcome(data, made("periodic_disturbance", frequency_hz=line_hz))
    assert motions_own_wave(found.final) is None


def test_a_wave_beside_a_harmonic_is_refuted_where_the_harmonic_takes_nearly_as_much():
    t = seconds(2.5 / PROGRAM_HZ)
    in_step = 0.5 * np.sin(2.0 * np.pi * 2.0 * PROGRAM_HZ * t)
    data = driven(of_program(t), in_step)
    beside_hz = 2.0 * PROGRAM_HZ + 0.07 / t[-1]  # its phase leaves the motion's by 0.13 rad rms
    found = outcome(data, made("periodic_disturbance", frequency_hz=beside_hz))
    refuted = motions_own_wave(found.final)
    assert refuted is not None
    assert "2 cycles" in refuted[1]


def to_and_fro(t):
    return 0.3 * np.sin(2.0 * np.pi * 0.4 * t)


def test_a_gap_is_refuted_that_only_the_ripple_of_the_measured_motion_shows():
    t = seconds(20.0)
    data = driven(to_and_fro(t))
    rippled = np.random.default_rng(5).standard_normal(len(t))
    rippled = np.convolve(rippled, np.ones(4) / 4.0, "same") * 1e-4
    found = outcome(recording(to_and_fro(t) + rippled, data.command), made("backlash", **GAP))
    refuted = gap_in_ripple(found.final)
    assert refuted is not None
    assert "answers to the ripple of the measured motion" in refuted[1]
    assert refuted[1] in without_refuted(found)[1]


def test_a_gap_stands_that_is_passed_where_the_axis_turns_round():
    t = seconds(20.0)
    effect = made("backlash", **GAP)
    stretch = make_signals(driven(to_and_fro(t)), slope_s_m=900.0).stretches[0]
    push = np.interp(t, stretch.time_s, 0.1 * stretch.columns(effect)[0])
    found = outcome(driven(to_and_fro(t), push), effect)
    assert found.final.held_out < 0.5 * found.base.held_out
    assert gap_in_ripple(found.final) is None


def test_a_fine_wave_over_position_is_no_part_of_the_inertia_that_is_seen():
    t = seconds(60.0)
    pitch_m, swing_m = 0.02, 2e-4
    way = np.cumsum(0.02 + 0.02 * np.sin(np.pi * t / 60.0)) / RATE_HZ
    k = 2.0 * np.pi / pitch_m
    position = way + swing_m * np.sin(k * way)
    # the axis yields to the wave, so that its acceleration repeats with it
    wave = -3.0 * INERTIA * swing_m * (k * 0.03) ** 2 * np.sin(k * position)
    cogging = made("cogging", pitch_m=pitch_m, orders=(1,))
    found = outcome(driven(position, wave), cogging, side="command", band_hz=6.0)
    assert inertia_off(found.final, seen_inertia(found.base)) > 2.0
    kept, why = without_refuted(found)
    assert [effect.name for effect in kept.final.added] == ["cogging"], why
