"""Pauses between tests: what stands between them is what counts."""

import numpy as np
import pytest
from recorded_rows import sines, write_table

from motorctl.errors import DataError
from motorctl.log import read_recording


def test_pauses_between_tests_are_holes_and_no_reason_to_refuse(tmp_path):
    even = 0.005 * np.arange(1000)
    late = np.random.default_rng(1).uniform(0.0, 1e-3, 1000)
    table = sines(even) | {"time_s": even + late + np.where(np.arange(1000) < 600, 0.0, 120.0)}
    recording = read_recording(write_table(tmp_path / "a.csv", table))
    axis = recording.axes["x"]
    good = np.flatnonzero(axis.recorded)
    assert len(good) == pytest.approx(1000, abs=4)
    assert np.diff(good).max() * recording.period_s == pytest.approx(120.0, rel=0.01)


def steps_with_pauses(rows, pause_s):
    """Return the times of ten stretches of so many rows, which a busy computer takes unevenly."""
    random = np.random.default_rng(5)
    steps = 0.006 * random.uniform(0.8, 1.2, 10 * rows)
    steps[random.random(len(steps)) < 0.02] = 0.0145  # a computer that is late now and then
    steps[rows::rows] = pause_s
    return np.cumsum(steps)


def test_what_stands_between_pauses_is_used_however_long_they_are(tmp_path):
    time_s = steps_with_pauses(rows=165, pause_s=5.0)
    axis = (recording := read_recording(write_table(tmp_path / "a.csv", sines(time_s)))).axes["x"]
    paused_s = np.diff(np.flatnonzero(axis.recorded)).max() * recording.period_s
    assert paused_s == pytest.approx(5.0, rel=0.01)
    used = axis.recorded
    assert used.sum() * recording.period_s == pytest.approx(time_s[-1] - 9 * 5.0, rel=0.05)
    np.testing.assert_allclose(axis.position[used], np.sin(6.0 * recording.time_s[used]), atol=1e-3)
    assert any(note.startswith("9 holes") for note in recording.notes), recording.notes


def test_stretches_between_pauses_that_are_too_short_are_refused_with_their_rows(tmp_path):
    time_s = steps_with_pauses(rows=60, pause_s=5.0)
    with pytest.raises(DataError, match=r"only 0 of 600 rows stand in stretches of at least 100 "):
        read_recording(write_table(tmp_path / "a.csv", sines(time_s)))


def test_a_long_test_behind_many_short_ones_does(tmp_path):
    steps = np.full(60 * 99 + 5000, 0.01)
    steps[99 : 60 * 99 + 1 : 99] = 19.0
    recording = read_recording(write_table(tmp_path / "a.csv", sines(np.cumsum(steps))))
    assert recording.axes["x"].recorded.sum() == pytest.approx(len(steps), abs=130)


def test_a_pause_that_would_fill_the_memory_is_refused_with_its_length(tmp_path):
    time_s = steps_with_pauses(rows=165, pause_s=3600.0)
    with pytest.raises(DataError, match=r"times the 1650 that there are \(limit 50\): cut out one"):
        read_recording(write_table(tmp_path / "a.csv", sines(time_s)))


def test_samples_that_come_with_events_are_refused(tmp_path):
    random = np.random.default_rng(2)
    steps = np.where(random.random(1000) < 0.965, 0.005, 0.3)
    with pytest.raises(DataError, match="more samples are missing than there are"):
        read_recording(write_table(tmp_path / "a.csv", sines(np.cumsum(steps))))
