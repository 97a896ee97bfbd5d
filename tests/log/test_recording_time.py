"""The time base: skipped periods of our own logs are legitimate, irregular times are not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_rows import columns, make_rows, sines, write_log, write_table

from motorctl.errors import DataError
from motorctl.log import read_recording
from motorctl.log.sample import SampleFlag


def log_with(tmp_path, ticks, **metadata):
    return write_log(tmp_path / "a.parquet", make_rows(len(ticks), ticks=ticks), metadata)


@settings(max_examples=20)
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


def test_a_hole_is_filled_told_and_marked(tmp_path):
    time_s = np.arange(2000) / 200
    kept = np.r_[0:800, 812:2000]
    table = {name: values[kept] for name, values in sines(time_s).items()}
    recording = read_recording(write_table(tmp_path / "a.csv", table))
    axis = recording.axes["x"]
    assert recording.sample_rate_hz == 200.0
    np.testing.assert_allclose(recording.time_s, time_s)
    np.testing.assert_array_equal(np.flatnonzero(~axis.recorded), np.arange(800, 812))
    np.testing.assert_allclose(axis.position[kept], table["x.position_m"], atol=1e-9)
    assert "12 samples of 2000 were not recorded" in recording.notes[0]


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), apart=st.floats(0.3, 0.8))
def test_uneven_samples_are_brought_to_their_mean_rate(tmp_path_factory, seed, apart):
    random = np.random.default_rng(seed)
    steps = 0.005 * random.uniform(1 - apart, 1 + apart, 1000)
    path = tmp_path_factory.mktemp("uneven") / "a.csv"
    recording = read_recording(write_table(path, sines(np.cumsum(steps))))
    axis = recording.axes["x"]
    assert recording.sample_rate_hz == pytest.approx(1 / np.mean(steps), rel=1e-2)
    np.testing.assert_allclose(np.diff(recording.time_s), recording.period_s)
    np.testing.assert_allclose(axis.position, np.sin(6.0 * recording.time_s), atol=6e-4)
    np.testing.assert_allclose(np.unique(axis.command)[[0, -1]], [-1.0, 1.0])
    held = np.cumsum(np.sign(np.cos(6.0 * np.cumsum(steps)))[:-1] * steps[1:])
    np.testing.assert_allclose(
        np.cumsum(axis.command)[-2] * recording.period_s, held[-1], atol=0.02
    )
    assert "samples are uneven" in recording.notes[0]


def test_a_hole_among_uneven_samples_is_marked(tmp_path):
    time_s = np.cumsum(0.005 * np.random.default_rng(1).uniform(0.5, 1.5, 2000))
    kept = np.r_[0:800, 830:2000]
    table = {name: values[kept] for name, values in sines(time_s).items()}
    axis = (recording := read_recording(write_table(tmp_path / "a.csv", table))).axes["x"]
    holes = recording.time_s[~axis.recorded]
    assert time_s[799] < holes[0] < holes[-1] < time_s[830]
    good = axis.recorded
    np.testing.assert_allclose(axis.position[good], np.sin(6.0 * recording.time_s[good]), atol=6e-4)


def test_a_clock_that_alternates_while_the_motion_does_not_is_taken_as_uniform(tmp_path):
    time_s = np.arange(1000) * 0.011
    late = time_s + np.where(np.arange(1000) % 2, 0.0, 0.004)
    table = sines(time_s) | {"time_s": late}
    recording = read_recording(write_table(tmp_path / "a.csv", table))
    np.testing.assert_allclose(recording.axes["x"].position, table["x.position_m"], atol=1e-9)
    assert "position does not show" in recording.notes[0]


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), late=st.floats(0.1, 0.2))
def test_stamps_that_are_late_move_no_sample_though_some_are_missing(tmp_path_factory, seed, late):
    random = np.random.default_rng(seed)
    even = 0.005 * np.arange(6000)
    kept = np.ones(6000, dtype=bool)
    kept[np.arange(150, 5900, 300) + random.integers(0, 100, 20)] = False
    kept[3000:3025] = False
    stamps = even + 0.005 * np.minimum(random.exponential(late, 6000), 0.9)
    table = {name: values[kept] for name, values in (sines(even) | {"time_s": stamps}).items()}
    path = tmp_path_factory.mktemp("late") / "a.csv"
    recording = read_recording(write_table(path, table))
    axis = recording.axes["x"]
    assert recording.sample_rate_hz == pytest.approx(200.0, rel=3e-4)
    assert len(recording.time_s) == 6000
    used = axis.recorded.copy()
    used[2990:3035] = False  # where a long hole begins and ends is told to a sample
    assert used.sum() > 5900
    np.testing.assert_allclose(axis.position[used], np.sin(6.0 * even)[used], atol=1e-4)
    assert "single samples" in " ".join(recording.notes)


def test_between_uneven_samples_a_steady_acceleration_is_met_exactly(tmp_path):
    time_s = 0.005 * (np.arange(1000) + np.random.default_rng(4).uniform(-0.3, 0.3, 1000))
    table = sines(time_s) | {"x.position_m": 0.5 * time_s**2}
    recording = read_recording(write_table(tmp_path / "a.csv", table))
    inner = slice(3, -3)
    np.testing.assert_allclose(
        recording.axes["x"].position[inner], 0.5 * recording.time_s[inner] ** 2, atol=1e-9
    )


def test_a_few_blank_values_are_filled_told_and_marked(tmp_path):
    table = sines(np.arange(2000) / 200)
    table["x.command_v"][[30, 31, 900]] = np.nan
    axis = (recording := read_recording(write_table(tmp_path / "a.csv", table))).axes["x"]
    np.testing.assert_array_equal(np.flatnonzero(~axis.recorded), [30, 31, 900])
    assert np.isfinite(axis.command).all()
    assert "3 of 2000 values of column 'x.command_v' are blank" in recording.notes[0]


def stop(time_s):
    time_s = time_s.copy()
    time_s[20:] += 0.995
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
        (stop, r"row 21 \(line 22\): column 'time_s' steps by 1 s, usually by 0\.005 s, and more"),
        (swap, r"row 22 \(line 23\): column 'time_s' runs backwards: 0\.1 after 0\.105"),
        (repeat, r"row 21 \(line 22\): column 'time_s' repeats 0\.095"),
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


@pytest.mark.parametrize("waiting", [1, 5])
def test_rows_written_before_the_clock_ran_are_left_out_and_told(tmp_path, waiting):
    """As LabVIEW writes its first row before its clock has run."""
    table = columns()
    table = {name: np.r_[[values[0]] * waiting, values] for name, values in table.items()}
    write_table(tmp_path / "a.csv", table)
    (tmp_path / "a.yaml").write_text(
        "file: a.csv\ntime: {column: time_s}\naxes:\n  slide:\n"
        "    position: {column: slide.position_m, unit: m}\n"
        "    command: {column: slide.command_v, unit: V}\n"
    )
    recording = read_recording(tmp_path / "a.yaml")
    assert len(recording.time_s) == len(table["time_s"]) - waiting
    assert recording.time_s[0] == table["time_s"][0]
    rows = f"{waiting} rows" if waiting > 1 else "a row"
    told = f"{rows} written before the clock ran left out, the first: row 1 (line 2)"
    assert recording.notes == (told,)


def test_times_of_too_few_digits_are_refused_with_the_way_out(tmp_path):
    table = columns()
    table["time_s"] = np.floor(table["time_s"] * 100.0) / 100.0
    with pytest.raises(DataError) as refusal:
        read_recording(write_table(tmp_path / "a.csv", table))
    told = str(refusal.value)
    assert "row 2 (line 3): column 'time_s' repeats 0 after 0; 32 of 64 rows" in told
    assert "sample_rate_hz: 203.226" in told  # 63 steps in 0.31 s
    (tmp_path / "a.yaml").write_text(
        "file: a.csv\nsample_rate_hz: 200\naxes:\n  slide:\n"
        "    position: {column: slide.position_m, unit: m}\n"
        "    command: {column: slide.command_v, unit: V}\n"
    )
    assert read_recording(tmp_path / "a.yaml").sample_rate_hz == 200.0
