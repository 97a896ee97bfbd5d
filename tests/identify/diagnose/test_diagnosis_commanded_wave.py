"""A sine in the command that the motion does not answer: another's force, or nobody's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.diagnose.recording import diagnose_axis

FREQUENCY_HZ = 1.7


def answered_by_nothing(times, *more_hz):
    """Return an axis with sines in its command that something else takes back.

    Each is `times` as large in rms as what moves the axis. Another axis is recorded beside it,
    which might do that.
    """
    data, beside = (OtherPlant().run(seed=seed, duration_s=10.0) for seed in (4, 9))
    size = times * np.sqrt(2.0) * np.std(data.command)
    waves = sum(np.sin(2 * np.pi * hz * data.time_s) for hz in (FREQUENCY_HZ, *more_hz))
    return replace(data, command=data.command + size * waves, others={"y": beside})


@pytest.mark.slow
def test_a_force_that_the_loop_answers_beside_its_motion_is_named():
    found = diagnose_axis(answered_by_nothing(0.5), C1)
    named = {effect.name: effect for effect in found.effects}
    disturbance = named["periodic_disturbance"]
    assert disturbance.effect.options.frequency_hz == pytest.approx(FREQUENCY_HZ, abs=0.01)


@pytest.mark.slow
def test_a_force_that_cancels_the_whole_command_is_not():
    found = diagnose_axis(answered_by_nothing(3.5), C1)
    assert "periodic_disturbance" not in {effect.name for effect in found.effects}
    assert any("the command itself is a sine of 1.7 Hz" in note for note in found.notes)


@pytest.mark.slow
def test_a_force_that_cancels_one_of_the_two_sines_of_a_command_is_not():
    data = replace(answered_by_nothing(3.5, 4.1), reference=None)
    found = diagnose_axis(data, C1)
    assert "periodic_disturbance" not in {effect.name for effect in found.effects}
    (told,) = [note for note in found.notes if "the command itself is sines of" in note]
    assert "1.7" in told
    assert "4.1" in told
