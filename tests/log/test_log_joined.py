"""Recordings made one after the other, read as one with gaps in its time."""

import numpy as np
import pytest

from motorctl.errors import DataError
from motorctl.log.joined import joined
from motorctl.log.recording import AxisRecording, Recording


def recording(begin_s, rows=50, rate_hz=1000.0, **columns):
    t = begin_s + np.arange(rows) / rate_hz
    axis = AxisRecording("x", np.sin(t), np.cos(t), **columns)
    return Recording(f"from {begin_s:g} s", rate_hz, t, {"x": axis})


def test_rows_follow_each_other_and_times_stay_as_they_were():
    parts = [recording(0.0), recording(3.0, 20)]
    whole = joined(parts)
    assert len(whole.time_s) == 70
    assert whole.time_s[50] == 3.0
    assert np.array_equal(whole.axes["x"].position[50:], parts[1].axes["x"].position)


def test_a_column_that_only_some_have_is_left_out():
    zeros = np.zeros(50)
    whole = joined([recording(0.0, reference=zeros), recording(3.0)])
    assert whole.axes["x"].reference is None


def test_a_recording_that_begins_before_the_last_ended_is_refused_with_both_times():
    with pytest.raises(DataError, match=r"from 0\.02 s begins at 0\.02 s, before .* at 0\.049 s"):
        joined([recording(0.0), recording(0.02)])


def test_other_rates_or_axes_are_refused():
    with pytest.raises(DataError, match="its axes or its rate are not those of from 0 s"):
        joined([recording(0.0), recording(3.0, rate_hz=500.0)])
