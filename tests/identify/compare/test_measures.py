"""The published measures, against signals whose measures are known by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_rows import back_and_forth

from motorctl.errors import DataError
from motorctl.identify.columns.repetition import find_period, repeats
from motorctl.identify.compare.measures import (
    Measures,
    measure_axis,
    measure_recording,
    measure_timing,
    measured_document,
    table_cells,
    table_headings,
)
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState

RATE_HZ = 1000.0


def recording(error, reference=None, *, state=None, config=None, command=None, time_s=None):
    """A recording of one axis x with a given tracking error."""
    count = len(error)
    time_s = np.arange(count) / RATE_HZ if time_s is None else time_s
    if reference is None:
        reference = back_and_forth(time_s, 2.0)
    axis = AxisRecording(
        name="x",
        position=reference + error,
        command=np.zeros(count) if command is None else command,
        reference=reference,
        state=state,
    )
    metadata = {"config": config} if config else {}
    return Recording("made up", RATE_HZ, time_s, {"x": axis}, metadata)


def config_with(period_s):
    program = {"kind": "back_and_forth", "period_s": period_s}
    return {"axes": {"x": {"program": "p"}}, "programs": {"p": program}}


def test_a_sine_has_its_analytic_measures():
    time_s = np.arange(10_000) / RATE_HZ
    error = 3e-5 * np.sin(2 * np.pi * 5 * time_s)
    command = -7.5 * np.cos(2 * np.pi * 5 * time_s)
    found = measure_axis(recording(error, command=command), "x").measures
    assert found.eM_m == pytest.approx(3e-5, rel=1e-6)
    assert found.eF_m == pytest.approx(3e-5, rel=1e-6)
    assert found.L2_m == pytest.approx(3e-5 / np.sqrt(2), rel=1e-6)
    assert found.uM_V == 7.5


@settings(max_examples=30)
@given(at=st.integers(0, 9999), size=st.floats(1e-6, 1e-3), sign=st.sampled_from([-1, 1]))
def test_a_peak_counts_for_ef_only_within_the_last_two_periods(at, size, sign):
    error = np.zeros(10_000)
    error[at] = sign * size
    run = measure_axis(recording(error), "x", 2.0)
    assert run.measures.eM_m == pytest.approx(size, rel=1e-9)
    assert run.measures.eF_m == pytest.approx(size if at >= 6000 else 0.0, rel=1e-9, abs=1e-15)
    assert run.last_rows == slice(6000, 10_000)


def test_the_period_of_the_program_is_taken_where_the_reference_repeats_so():
    run = measure_axis(recording(np.zeros(10_000), config=config_with(2.0)), "x")
    assert (run.period_s, run.period_from) == (2.0, "of the program")


def test_a_program_that_was_not_the_one_that_ran_is_not_believed():
    run = measure_axis(recording(np.zeros(10_000), config=config_with(1.3)), "x")
    assert run.period_s == pytest.approx(2.0, abs=2e-3)
    assert "autocorrelation" in run.period_from


def test_a_given_period_is_taken_whatever_the_log_says():
    run = measure_axis(recording(np.zeros(10_000), config=config_with(2.0)), "x", 1.0)
    assert (run.period_s, run.period_from) == (1.0, "as given")
    assert run.last_rows == slice(8000, 10_000)


def test_without_any_period_the_last_third_counts_and_is_named():
    error = np.zeros(9000)
    error[5999], error[6000] = 2e-5, 1e-5
    reference = np.linspace(0, 1, 9000) ** 2
    run = measure_axis(recording(error, reference), "x")
    assert run.period_s is None
    assert "last third" in run.period_from
    assert run.measures.eF_m == pytest.approx(1e-5)


def test_a_run_shorter_than_two_periods_counts_whole():
    error = np.zeros(3000)
    error[0] = 1e-5
    run = measure_axis(recording(error, config=config_with(2.0)), "x")
    assert run.period_s == 2.0
    assert run.measures.eF_m == pytest.approx(1e-5)


def test_the_last_two_periods_end_where_the_motion_ends():
    time_s = np.arange(20_000) / RATE_HZ
    reference = np.where(time_s < 10.0, back_and_forth(time_s, 2.0), 0.0)
    error = np.zeros(20_000)
    error[8000] = 1e-5
    run = measure_axis(recording(error, reference), "x", 2.0)
    assert run.measures.eF_m == pytest.approx(1e-5)
    assert 9000 < run.last_rows.stop <= 10_001


def test_rows_before_the_program_after_it_and_out_of_control_do_not_count():
    error = np.full(10_000, 1e-6)
    error[100] = 1.0  # before the program
    error[5000] = 2.0  # in a fault between two runs of it
    error[9900] = 3.0  # after it
    state = np.full(10_000, AxisState.RUNNING)
    state[:500], state[4990:5100], state[9500:] = AxisState.OFF, AxisState.FAULT, AxisState.IDLE
    run = measure_axis(recording(error, state=state), "x", 2.0)
    assert run.rows == slice(500, 9500)
    assert run.measures.eM_m == pytest.approx(1e-6)
    assert run.measures.L2_m == pytest.approx(1e-6)


def test_an_axis_that_was_never_enabled_is_measured_whole():
    state = np.full(3000, AxisState.OFF)
    assert measure_axis(recording(np.full(3000, 1e-6), state=state), "x").rows == slice(0, 3000)


def test_rows_with_gaps_in_time_are_measured_by_their_times():
    kept = np.r_[0:5000, 7000:10_000]
    error = np.zeros(8000)
    error[4999], error[5000] = 2e-5, 1e-5  # 4.999 s, 7.000 s
    run = measure_axis(recording(error, time_s=kept / RATE_HZ), "x", 2.0)
    assert run.measures.eF_m == pytest.approx(1e-5)


def test_an_axis_without_reference_is_told_or_left_out():
    made = recording(np.zeros(100))
    bare = AxisRecording(name="x", position=np.zeros(100), command=np.zeros(100))
    without = Recording("foreign.csv", RATE_HZ, made.time_s, {"x": bare})
    with pytest.raises(DataError, match=r"foreign\.csv: axis x: no reference is known"):
        measure_axis(without, "x")
    assert measure_recording(without) == {}


@pytest.mark.parametrize(
    "config",
    [{"axes": None}, {"axes": {"x": {"program": "p"}}, "programs": {}}, {"axes": {"x": []}}],
)
def test_a_foreign_configuration_in_the_metadata_does_no_harm(config):
    assert measure_axis(recording(np.zeros(10_000), config=config), "x").period_s is not None


@settings(max_examples=40)
@given(period=st.floats(0.3, 4.0), cycles=st.floats(2.2, 12.0), distance=st.floats(1e-4, 1.0))
def test_the_period_is_found_in_a_reference_that_repeats(period, cycles, distance):
    time_s = np.arange(0.0, period * cycles, 1e-3)
    reference = 5.0 + back_and_forth(time_s, period, distance)
    assert find_period(time_s, reference) == pytest.approx(period, rel=0.01)
    assert repeats(time_s, reference, period)
    assert not repeats(time_s, reference, 0.73 * period)


@pytest.mark.parametrize("shape", ["rest", "ramp", "once", "noise"])
def test_no_period_is_found_where_nothing_repeats(shape):
    time_s = np.arange(0.0, 10.0, 1e-3)
    reference = {
        "rest": np.full(10_000, 0.3),
        "ramp": time_s,
        "once": np.clip(time_s - 4.0, 0.0, 0.4),
        "noise": np.random.default_rng(0).normal(size=10_000),
    }[shape]
    assert find_period(time_s, reference) is None


def test_timing_is_measured_where_it_was_recorded():
    made = recording(np.zeros(1000))
    turnaround = np.full(1000, 1e-5)
    turnaround[[700, 701]] = 3e-4, np.nan
    timed = Recording(
        "a", RATE_HZ, made.time_s, made.axes, turnaround_s=turnaround, lateness_s=np.zeros(1000)
    )
    timing = measure_timing(timed)
    assert timing.lateness is None
    assert timing.turnaround.median_s == 1e-5
    assert timing.turnaround.worst_s == 3e-4
    assert timing.turnaround.worst_at_s == 0.7


def test_cells_have_the_digits_of_the_published_table():
    measures = Measures(eM_m=65.54e-6, eF_m=44.4e-6, L2_m=4.536e-6, uM_V=9.55)
    assert table_cells(measures) == ["65.5", "44.4", "4.54", "9.55"]
    assert table_headings() == ("eM µm", "eF µm", "L2[e] µm", "uM V")
    assert table_headings("rad", "A") == ("eM µrad", "eF µrad", "L2[e] µrad", "uM A")


def test_the_document_of_a_run_names_measures_and_period():
    document = measured_document(measure_axis(recording(np.zeros(5000)), "x", 1.0))
    measures = {"eM", "eF", "L2[e]", "uM"}
    assert document.keys() == measures | {"units", "period_s", "period_from"}
    assert document["units"] == {"eM": "m", "eF": "m", "L2[e]": "m", "uM": "V"}
