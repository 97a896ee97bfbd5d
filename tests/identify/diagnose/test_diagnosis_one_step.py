"""A step and a rest, or rows too far apart, tell nothing: said with what would, not "unknown"."""

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.fit.recording import fit_axis

RATE_HZ = 1000.0
GAIN = 3.0
"""Of the loop that holds the arm [V/rad]."""


def stepped(times_s):
    """Simulate an arm with a pendulum that goes there and back at these times, else holds."""
    count, dt = round(8.0 * RATE_HZ), 1.0 / RATE_HZ
    x, command = np.zeros(count), np.zeros(count)
    velocity = angle = turning = 0.0
    for k in range(count - 1):
        target = 0.5 * (sum(k * dt > at for at in times_s) % 2)
        command[k] = GAIN * (target - x[k])
        friction = 0.2 * velocity + 0.05 * np.tanh(velocity / 0.005)
        acceleration = (command[k] + 2.0 * angle + 0.01 * turning - friction) / 0.006
        turning += dt * (-40.0 * angle - 0.2 * turning - 0.3 * acceleration)
        angle += dt * turning
        velocity += dt * acceleration
        x[k + 1] = x[k] + dt * velocity
    count_rad = 1.5e-3
    return Measured(
        source="a step", axis="arm", sample_rate_hz=RATE_HZ, time_s=dt * np.arange(count),
        position=count_rad * np.round(x / count_rad), command=command,
        usable=np.ones(count, dtype=bool), position_unit="rad", command_unit="V",
    )  # fmt: skip


@pytest.mark.slow
def test_one_step_and_a_rest_are_insufficient_data_with_the_motion_that_would_tell():
    told = diagnose_axis(stepped([0.5]), C1)
    assert told.verdict == "insufficient_data"
    assert "nearly all of its motion is one move" in told.sentence
    assert "record moves there and back" in told.sentence
    assert told.missing


@pytest.mark.slow
def test_many_steps_of_the_same_arm_are_not_called_one_move():
    told = diagnose_axis(stepped(np.arange(0.5, 7.5, 0.7)), C1)
    assert "one move" not in told.sentence


@pytest.mark.parametrize("answer", [diagnose_axis, fit_axis])
def test_rows_that_are_too_far_apart_for_any_axis_are_refused_with_the_rate_that_would_do(answer):
    """As a table of settled speeds, written every 5.5 s."""
    moved = stepped([0.5])
    slow = replace(moved, sample_rate_hz=1.0 / 5.5, time_s=5.5 * np.arange(len(moved.position)))
    with pytest.raises(
        DataError, match=r"too slow: 0\.182 Hz, its rows are 5\.5 s apart"
    ) as refusal:
        answer(slow, C1)
    assert "at least 1 Hz is needed" in str(refusal.value)


def test_stretches_between_gaps_that_are_too_short_are_refused_with_their_length():
    moved = stepped([0.5])
    usable = np.arange(len(moved.position)) % 150 > 0
    with pytest.raises(DataError, match=r"reaches .* s without a gap, the longest lasts 0\.149 s"):
        diagnose_axis(replace(moved, usable=usable), C1)
