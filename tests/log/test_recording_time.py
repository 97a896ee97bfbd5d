"""The time base: skipped periods of our own logs are legitimate, irregular times are not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_rows import columns, make_rows, write_log, write_table

from motorctl.errors import DataError
from motorctl.log import read_recording
from motorctl.log.sample import SampleFlag


def log_with(tmp_path, ticks, **metadata):
    return write_log(tmp_path / "a.parquet", make_rows(len(ticks), ticks=ticks), metadata)


@settings(max_examples=20, deadline=None)
@given(missing=st.sets(st.integers(1, 198), min_size=1, max_size=30))
def test_short_gaps_are_filled_on_a_uniform_grid(tmp_path_factory, missing):
    kept = [k for k in range(200) if k not in missing]
    if max(np.diff(kept)) > 11:
        return
    rows = make_rows(len(kept), ticks=kept)
    recording = read_recording(write_log(tmp_path_factory.mktemp("gap") / "a.parquet", rows))
    np.testing.assert_allclose(np.diff(recording.time_s), 1e-3, rtol=1e-9)
    assert recording.rows_filled == len(missing)
    assert f"{len(missing)} skipped ticks of 200" in recording.notes[0]
    axis = recording.axes["x"]
    np.testing.assert_array_equal(axis.position[kept], rows[1]["position_m"][:, 0])
    np.testing.assert_allclose(
        axis.position, np.interp(np.arange(200), kept, rows[1]["position_m"][:, 0])
    )
    filled = sorted(missing)
    assert np.isnan(recording.lateness_s[filled]).all()
    assert np.isfinite(recording.lateness_s[kept]).all()


def test_codes_repeat_over_a_gap_and_are_never_mixed(tmp_path):
    ticks, samples = make_rows(40, ticks=[*range(20), *range(25, 45)])
    samples["flags"][:20, 0] = SampleFlag.HOMED
    samples["flags"][20:, 0] = SampleFlag.SATURATED
    flags = read_recording(write_log(tmp_path / "a.parquet", (ticks, samples))).axes["x"].flags
    assert flags[19:26].tolist() == [SampleFlag.HOMED] * 6 + [SampleFlag.SATURATED]


def test_of_a_log_with_long_gaps_the_longest_stretch_is_taken_and_told(tmp_path):
    path = log_with(tmp_path, [*range(30), *range(100, 180), *range(500, 520)])
    recording = read_recording(path)
    assert len(recording.time_s) == 80
    assert recording.time_s[0] == pytest.approx(0.1)
    assert "2 gaps of more than 10 ticks" in recording.notes[0]
    assert "row 31 to 110 of 130" in recording.notes[0]


def test_gaps_can_be_kept_as_they_are(tmp_path):
    ticks = [*range(30), *range(100, 180)]
    recording = read_recording(log_with(tmp_path, ticks), gaps="keep")
    np.testing.assert_allclose(recording.time_s, np.array(ticks) / 1000)
    assert recording.rows_filled == 0
    assert recording.notes == ("70 ticks are missing",)


def test_the_rate_that_a_log_names_is_taken_exactly(tmp_path):
    path = log_with(tmp_path, range(1000), rate_hz=1000.00001)
    assert read_recording(path).sample_rate_hz == 1000.00001
    other = log_with(tmp_path / "b", range(1000), rate_hz=2000.0)
    assert read_recording(other).sample_rate_hz == 1000.0


def test_jitter_of_time_stamps_is_tolerated(tmp_path):
    random = np.random.default_rng(0)
    table = columns()
    table["time_s"] = table["time_s"] + random.uniform(-0.1, 0.1, len(table["time_s"])) / 200
    table["time_s"][[0, -1]] = columns()["time_s"][[0, -1]]
    recording = read_recording(write_table(tmp_path / "a.csv", table))
    assert recording.sample_rate_hz == 200.0
    np.testing.assert_allclose(np.diff(recording.time_s), 1 / 200)


def wander(time_s):
    return time_s + 0.004 * np.sin(2 * np.pi * time_s / time_s[-1])


def drop(time_s):
    time_s = time_s.copy()
    time_s[20:] += 0.05
    return time_s


def swap(time_s):
    time_s = time_s.copy()
    time_s[[20, 21]] = time_s[[21, 20]]
    return time_s


def repeat(time_s):
    time_s = time_s.copy()
    time_s[20] = time_s[19]
    return time_s


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (drop, r"row 21 \(line 22\): column 'time_s' steps by 0\.055 s, elsewhere by 0\.005 s"),
        (swap, r"row 22 \(line 23\): column 'time_s' runs backwards: 0\.1 after 0\.105"),
        (repeat, r"row 21 \(line 22\): column 'time_s' repeats 0\.095"),
        (wander, r"periods, off a uniform grid \(limit 0\.25\)"),
        (lambda t: t * 1e-12, r"samples a second; .* is the unit of time right"),
        (lambda t: t[:15], r"15 rows; at least 16"),
    ],
)
def test_times_that_are_not_uniform_are_refused_with_their_place(tmp_path, spoil, message):
    table = columns()
    time_s = spoil(table["time_s"])
    table = {name: values[: len(time_s)] for name, values in table.items()} | {"time_s": time_s}
    with pytest.raises(DataError, match=message):
        read_recording(write_table(tmp_path / "a.csv", table))


@pytest.mark.parametrize(
    ("ticks", "message"),
    [
        ([*range(20), 18, *range(21, 40)], r"row 21: column 'tick' runs backwards: 18 after 19"),
        ([*range(20), *range(19, 40)], r"row 21: column 'tick' repeats 19"),
    ],
)
def test_ticks_that_do_not_count_up_are_refused(tmp_path, ticks, message):
    rows = make_rows(len(ticks), ticks=ticks)
    rows[0]["time_s"] = np.arange(len(ticks)) / 1000
    with pytest.raises(DataError, match=message):
        read_recording(write_log(tmp_path / "a.parquet", rows))


def test_a_tick_that_is_no_count_is_refused(tmp_path):
    table = columns()
    with pytest.raises(DataError, match=r"column 'tick' is 0\.005"):
        read_recording(write_table(tmp_path / "a.csv", table | {"tick": table["time_s"]}))
