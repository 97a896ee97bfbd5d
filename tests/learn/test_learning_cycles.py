"""The cycles of a log: placed by the reference, and refused where they are not the program's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from motorctl.config import load
from motorctl.errors import DataError, UsageError
from motorctl.learn.cycles import Repetition, cycles_of
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState
from motorctl.motion import BackAndForth, Program

RATE_HZ = 1000.0
LEAD_S = 0.7361
"""Of the way to the start: no whole number of ticks."""


def program(cycles: int = 6, distance_m: float = 0.1) -> BackAndForth:
    return BackAndForth(
        name="there", axis="x", start_m=0.0, distance_m=distance_m, max_velocity_m_s=0.5,
        max_acceleration_m_s2=5.0, jerk_time_s=0.02, period_s=1.5, cycles=cycles,
    )  # fmt: skip


def log(followed: Program, noise_m: float = 0.0) -> Recording:
    """Return a log in which the axis' error is a sine of the place in the cycle, 1 um high."""
    trajectory = followed.trajectories()["x"]
    time_s = np.arange(round((LEAD_S + trajectory.duration_s + 0.3) * RATE_HZ)) / RATE_HZ
    passed_s = time_s - LEAD_S
    x, v, _ = trajectory.sample(passed_s)
    error = 1e-6 * np.sin(2 * np.pi * passed_s / 1.5)
    error += noise_m * np.random.default_rng(3).normal(size=len(time_s))
    running = (passed_s > -0.5) & (passed_s <= trajectory.duration_s)
    state = np.where(running, AxisState.RUNNING, AxisState.IDLE).astype(np.int64)
    axis = AxisRecording(
        name="x", position=x + error, command=np.zeros_like(x), reference=x,
        reference_velocity=v, state=state, learned=0.2 * np.cos(2 * np.pi * passed_s / 1.5),
    )  # fmt: skip
    return Recording(source="run", sample_rate_hz=RATE_HZ, time_s=time_s, axes={"x": axis})


def test_what_repeats_is_found_at_its_place_and_told_from_what_does_not() -> None:
    found = cycles_of(log(program(), noise_m=0.3e-6), "x", program())
    place = np.arange(found.points) / found.points
    assert found.error.shape == (4, 1500)  # the first third settles
    np.testing.assert_allclose(found.learned, 0.2 * np.cos(2 * np.pi * place), atol=2e-6)
    assert found.repeats_rms_m == pytest.approx(1e-6 / np.sqrt(2), rel=0.02)
    assert found.left_over_rms_m == pytest.approx(0.3e-6, rel=0.25)  # less what two rows share
    fundamental = np.fft.rfft(found.mean_error)[1] / found.points * 2
    assert fundamental == pytest.approx(-1e-6j, abs=0.03e-6)


def test_another_motion_a_part_of_it_and_none_are_refused() -> None:
    with pytest.raises(DataError, match=r"not the whole of 'there' \(its reference is .* off\)"):
        cycles_of(log(program(distance_m=0.12)), "x", program())
    with pytest.raises(DataError, match=r"not the whole of 'there': give a log that ends with it"):
        cycles_of(log(program(cycles=4)), "x", program())
    still = log(program())
    axis = dataclasses.replace(still.axes["x"], state=np.full(len(still.time_s), AxisState.IDLE))
    still = dataclasses.replace(still, axes={"x": axis})
    with pytest.raises(DataError, match="followed no program: give a log of 'there'"):
        cycles_of(still, "x", program())


def test_a_program_that_does_not_repeat_is_refused() -> None:
    ring = load("published_gantry").programs["ring"]
    for wrong, words in ((ring, "'ring' does not repeat"), (program(2), "needs 3, so that")):
        with pytest.raises(UsageError, match=words):
            cycles_of(log(program()), "x", wrong)


def test_of_noise_alone_nothing_repeats() -> None:
    noise = np.random.default_rng(5).normal(0.0, 1e-6, (8, 4000))
    found = Repetition("x", "run", 1.0, noise, np.zeros(4000), np.zeros(4000))
    assert found.repeats_rms_m < found.noise_of_mean_m
    assert found.rms_m == pytest.approx(1e-6, rel=0.02)


def test_a_few_rows_may_be_missing_and_more_may_not() -> None:
    whole = log(program())
    for missing, ok in ((8, True), (40, False)):
        kept = np.ones(len(whole.time_s), bool)
        kept[5000 : 5000 + missing] = False
        old = whole.axes["x"]
        columns = {
            field.name: value[kept]
            for field in dataclasses.fields(old)
            if isinstance(value := getattr(old, field.name), np.ndarray)
        }
        axis = dataclasses.replace(old, **columns)
        holed = dataclasses.replace(whole, time_s=whole.time_s[kept], axes={"x": axis})
        if ok:
            assert cycles_of(holed, "x", program()).repeats_rms_m == pytest.approx(
                7.07e-7, rel=0.02
            )
        else:
            with pytest.raises(DataError, match=r"rows are missing at 4\.999 s"):
                cycles_of(holed, "x", program())
