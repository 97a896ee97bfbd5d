"""The command of uneven samples: written with each row, or read when a recorder came by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import plain_model
from motorctl.identify.diagnose.verdict.late_command import read_between


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


def test_of_even_samples_nothing_is_asked(sound):
    late = half_late(sound)
    assert read_between(late, heard(late)) == (late, None)
