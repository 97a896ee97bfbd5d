"""The command of uneven samples: written with each row, or read when a recorder came by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import plain_model
from motorctl.identify.diagnose.verdict.late_command import LateColumn, read_between


@pytest.fixture(scope="module")
def sound():
    every = OtherPlant().run(seed=2, duration_s=6.0)
    return replace(
        every, sample_rate_hz=500.0, time_s=every.time_s[::10], position=every.position[::10],
        command=every.command.reshape(-1, 10).mean(axis=1), reference=None,
        usable=every.usable[::10],
    )  # fmt: skip


def heard(data) -> Hypothesis:
    return plain_model(make_signals(data, slope_s_m=900.0), C1)


def half_late(data):
    return replace(data, command=0.5 * (data.command + np.roll(data.command, 1)))


def test_a_command_that_a_recorder_read_late_is_taken_half_a_period_earlier(sound):
    late = replace(half_late(sound), uneven=True)
    found, note = read_between(late, heard(late))
    np.testing.assert_allclose(found.command[1:-1], 0.5 * (late.command[1:-1] + late.command[2:]))
    assert "1 ms before it was recorded" in note


def test_a_command_that_was_written_with_each_row_stays_as_it_is(sound):
    written = replace(sound, uneven=True)
    assert read_between(written, heard(written)) == (written, None)


def test_a_command_of_even_samples_stays_as_it_is_where_it_is_held(sound):
    assert read_between(sound, heard(sound)) == (sound, None)


@pytest.fixture(scope="module")
def measured():
    """An axis whose current was measured with each position, at 100 Hz."""
    every = np.arange(20_000) / 2000.0
    current = sum(
        np.sin(2.0 * np.pi * hz * every + phase)
        for hz, phase in ((0.7, 0.0), (1.9, 1.0), (3.1, 2.0), (5.3, 0.5), (7.9, 1.5))
    )
    position, speed = np.zeros(len(every)), 0.0
    for k in range(1, len(every)):
        friction = 0.6 * speed + 0.2 * np.tanh(speed / 0.01)
        speed += (current[k - 1] - friction) / 0.05 / 2000.0
        position[k] = position[k - 1] + speed / 2000.0
    noise = 1e-5 * np.random.default_rng(2).standard_normal(len(every))
    return Measured(
        source="measured.csv", axis="x", sample_rate_hz=100.0, time_s=every[::20],
        position=(position + noise)[::20], command=current[::20],
        usable=np.ones(len(every[::20]), np.bool_), position_unit="m", command_unit="A",
    )  # fmt: skip


def test_a_current_that_was_measured_with_each_position_is_not_held_from_its_row_on(measured):
    axis = diagnose_axis(measured, C1)
    assert any("measured with the position, and not held" in note for note in axis.notes)
    inertia, _, friction, _ = axis.theta[:4]
    assert inertia == pytest.approx(0.05, rel=0.03)
    assert friction == pytest.approx(0.2, rel=0.1)
    late = LateColumn(late_s=0.02, left=0.5, recorded=1.0, band_hz=10.0)
    assert read_between(measured, heard(measured), late) == (measured, None)
