"""Rows whose error a missing sample made, and what is left to measure without them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.identify.compare.disturbed_rows import DISTURBED_S, disturbed_rows
from motorctl.identify.compare.measures import measure_axis
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import SampleFlag

RATE_HZ, ROWS = 500.0, 4000
AFTER = round(DISTURBED_S * RATE_HZ)


def recording(error=None, flags=None, lost=()):
    time_s = np.delete(np.arange(ROWS) / RATE_HZ, lost)
    count = len(time_s)
    error = np.full(count, 1e-6) if error is None else error
    reference = np.sin(2.0 * np.pi * time_s)
    axis = AxisRecording(
        name="x", position=reference + error, command=np.zeros(count), reference=reference,
        flags=np.zeros(count, np.int64) if flags is None else flags,
    )  # fmt: skip
    return Recording("made up", RATE_HZ, time_s, {"x": axis}, {})


@given(
    at=st.integers(0, ROWS - 1),
    flag=st.sampled_from([SampleFlag.HELD, SampleFlag.SKIPPED]),
)
def test_rows_count_for_nothing_for_a_while_after_a_sample_that_is_missing(at, flag):
    flags = np.zeros(ROWS, np.int64)
    flags[at] = flag
    found = disturbed_rows(recording(flags=flags), "x")
    assert found[at : at + AFTER].all()
    assert not found[:at].any()
    assert not found[at + AFTER + 1 :].any()


def test_rows_that_were_lost_are_samples_that_are_missing():
    assert np.flatnonzero(disturbed_rows(recording(lost=range(1000, 1008)), "x"))[0] == 1000


def test_what_a_missing_sample_made_of_the_error_is_not_measured():
    flags, error = np.zeros(ROWS, np.int64), np.full(ROWS, 1e-6)
    flags[3000], error[3000:3050] = SampleFlag.HELD, 1e-3
    spoiled = recording(error, flags)
    assert measure_axis(spoiled, "x").measures.eF_m == pytest.approx(1e-3)
    left_out = disturbed_rows(spoiled, "x")
    found = measure_axis(spoiled, "x", left_out=left_out).measures
    assert found.eM_m == found.eF_m == pytest.approx(1e-6)


def test_where_samples_are_missing_all_along_every_row_counts():
    flags = np.zeros(ROWS, np.int64)
    flags[:: AFTER // 2] = SampleFlag.HELD
    assert not disturbed_rows(recording(flags=flags), "x").any()
