"""Data from which nothing can be learnt: one clear message each."""

import numpy as np
import pytest
from fit_plant import C1, simulate

from motorctl.errors import DataError
from motorctl.identify.fit.recording import fit_axis, fit_recording
from motorctl.identify.fit.settings import FitOptions
from motorctl.log import AxisRecording, Recording


@pytest.fixture(scope="module")
def run():
    return simulate(seed=1, duration_s=4.0)


def changed(run, **fields):
    return run.measured(**fields)


def refusal(data, options=None):
    with pytest.raises(DataError) as caught:
        fit_axis(data, C1, options)
    message = str(caught.value)
    assert message.startswith("run.csv: axis x: ")
    assert "\n" not in message
    return message


def test_too_short_a_recording(run):
    few = slice(0, 90)
    names = ("time_s", "position", "command", "reference", "reference_velocity")
    fields = {name: getattr(run, name)[few] for name in names}
    message = refusal(run.measured(usable=np.ones(90, dtype=bool), **fields))
    assert "too short" in message
    assert "0.018 s" in message


def test_a_position_that_stays_within_a_few_counts(run):
    still = 0.2 + 0.5e-6 * (np.arange(len(run.position)) % 3)
    assert "no motion" in refusal(changed(run, position=still))
    assert "no motion" in refusal(changed(run, position=np.full_like(still, 0.2)))


def test_a_constant_command(run):
    message = refusal(changed(run, command=np.full_like(run.command, 0.5)))
    assert "constant at 0.5 V" in message


def test_a_command_that_is_saturated_throughout(run):
    flags = np.ones(len(run.command), dtype=bool)
    assert "saturated throughout" in refusal(changed(run, saturated=flags))
    slow = np.clip(300.0 * np.sin(2.0 * run.time_s), -10.0, 10.0)
    assert "are at 10 V" in refusal(changed(run, command=slow))


def test_a_two_level_test_signal_is_not_called_saturated():
    rng = np.random.default_rng(0)
    command = np.repeat(rng.choice([-2.0, 2.0], 1500), 20)
    time = np.arange(len(command)) / 5000.0
    velocity = np.zeros(len(time))
    for k in range(1, len(time)):
        velocity[k] = velocity[k - 1] + (command[k - 1] - 1.0 * velocity[k - 1]) / 0.5 / 5000.0
    position = np.round(np.cumsum(velocity) / 5000.0 / 1e-7) * 1e-7
    run = simulate(duration_s=0.3)
    data = run.measured(
        time_s=time, position=position, command=command, usable=np.ones(len(time), dtype=bool),
        reference=None, reference_velocity=None,
    )  # fmt: skip
    assert fit_axis(data, C1).theta[0] == pytest.approx(0.5, rel=0.01)


def test_exchanged_columns(run):
    data = changed(
        run, position=run.command, command=run.position, reference=None, reference_velocity=None
    )
    assert "exchanged" in refusal(data)


def test_a_reversed_sign(run):
    assert "reversed" in refusal(changed(run, command=-run.command))


def test_a_command_that_has_nothing_to_do_with_the_motion(run):
    noise = np.random.default_rng(0).standard_normal(len(run.command))
    assert "explains none" in refusal(changed(run, command=noise))


def test_values_that_are_not_numbers(run):
    command = run.command.copy()
    command[250:252] = np.nan
    message = refusal(changed(run, command=command))
    assert "command is not a number in 2 rows, first at 0.05 s" in message


def test_an_axis_that_was_never_enabled(run):
    assert "never enabled" in refusal(changed(run, usable=np.zeros(len(run.command), dtype=bool)))


def test_a_filter_above_half_the_sample_rate(run):
    message = refusal(run.measured(), FitOptions(filter_hz=2600.0))
    assert "2600 Hz" in message
    assert "2500 Hz" in message


def test_stretches_too_short_for_the_filter(run):
    usable = np.arange(len(run.command)) % 200 > 0
    assert "settle" in refusal(changed(run, usable=usable), FitOptions(filter_hz=20.0))


def test_a_segment_without_rows(run):
    message = refusal(run.measured(), FitOptions(fit_segments=((50.0, 60.0),)))
    assert "50 to 60 s" in message


def test_friction_after_a_reference_that_is_not_there(run):
    data = changed(run, reference=None, reference_velocity=None)
    assert "reference" in refusal(data, FitOptions(friction_velocity="reference"))


def test_an_axis_that_stood_still_does_not_hinder_the_others(run):
    moved = AxisRecording("x", run.position, run.command)
    still = AxisRecording("y", np.full_like(run.position, 0.1), run.command)
    recording = Recording("run.csv", run.rate_hz, run.time_s, {"x": moved, "y": still})
    fit = fit_recording(recording, {"x": C1, "y": C1})
    assert list(fit.axes) == ["x"]
    assert "no motion" in fit.refused["y"]
    with pytest.raises(DataError, match="axis y: no motion"):
        fit_recording(recording, {"y": C1})
