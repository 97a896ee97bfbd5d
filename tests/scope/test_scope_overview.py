"""What a panel is told of a log: no peak is lost, and no more is read than is needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_rows import make_rows, write_log

import motorctl
from motorctl.scope import pyramid as overview
from motorctl.scope.opened_log import OpenedLog
from motorctl.scope.pyramid import BUCKET_ROWS, Pyramid
from motorctl.scope.signals import signals

ROWS = 200_000
RATE_HZ = 5000.0
ERROR = "x.following_error_m"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of four row groups with one peak of a single row."""
    ticks, samples = make_rows(ROWS, rate_hz=RATE_HZ)
    samples["following_error_m"][123_456, 0] = 1.0
    place: Path = tmp_path_factory.mktemp("log") / "long.parquet"
    write_log(place, (ticks, samples), {"rate_hz": RATE_HZ})
    return place


@pytest.fixture(scope="module")
def truth(path: Path) -> np.ndarray:
    return motorctl.open_log(path)[ERROR]


@pytest.fixture(scope="module")
def pyramid(path: Path) -> Pyramid:
    return Pyramid(motorctl.open_log(path))


@given(rows=st.tuples(st.integers(0, ROWS - 1), st.integers(1, ROWS)), pixels=st.integers(1, 2000))
def test_every_pixel_has_the_least_and_the_greatest_of_its_rows(
    pyramid: Pyramid, truth: np.ndarray, rows: tuple[int, int], pixels: int
) -> None:
    first, last = rows[0], min(rows[0] + rows[1], ROWS)
    found = pyramid.envelope(["tick", ERROR], first, last, pixels)
    assert not found.coarse
    begins, ends = found.low["tick"].astype(int), found.high["tick"].astype(int)
    # Pixels follow each other without a hole, and reach over the stretch by a bucket at most.
    assert (begins[1:] == ends[:-1] + 1).all()
    a_piece_in_a_pixel = last - first > pixels * (1 << 16)
    reach = (1 << 16) if a_piece_in_a_pixel else BUCKET_ROWS
    assert first - reach < begins[0] <= first
    assert last - 1 <= ends[-1] < last - 1 + reach
    assert len(begins) <= (2 * pixels if found.every_row else pixels + 1)
    for k in range(0, len(begins), 97):
        there = truth[begins[k] : ends[k] + 1]
        assert (found.low[ERROR][k], found.high[ERROR][k]) == (there.min(), there.max())


def test_a_peak_of_one_row_is_in_the_picture_of_the_whole_log(path: Path) -> None:
    told = signals(OpenedLog(path), [ERROR], 0.0, ROWS / RATE_HZ, 800)
    peak = told.arrays[ERROR].argmax()
    assert told.arrays[ERROR][peak] == 1.0
    assert told.arrays["time_s"][peak] == pytest.approx(123_456 / RATE_HZ, abs=0.06)


def test_a_log_whose_row_groups_are_less_than_a_pixel_is_told_without_reading_a_row(
    path: Path, monkeypatch: pytest.MonkeyPatch, truth: np.ndarray
) -> None:
    log = motorctl.open_log(path)
    pyramid = Pyramid(log)
    monkeypatch.setattr(log, "part", None)
    found = pyramid.envelope([ERROR], 0, ROWS, 3)
    assert not found.coarse
    assert (found.low[ERROR].min(), found.high[ERROR].max()) == (truth.min(), truth.max())


def test_a_long_log_is_told_in_steps_each_finer_than_the_one_before(
    path: Path, monkeypatch: pytest.MonkeyPatch, truth: np.ndarray
) -> None:
    clock = iter(range(1000))
    monkeypatch.setattr(overview.time, "monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(overview, "PATIENCE_S", 1.5)  # one row group of one column an answer
    pyramid = Pyramid(motorctl.open_log(path))
    told = [pyramid.envelope([ERROR], 0, ROWS, 400) for _ in range(5)]
    assert [each.coarse for each in told] == [True, True, True, False, False]
    lengths = [len(each.low[ERROR]) for each in told]
    assert lengths == sorted(lengths)
    for each in told:
        assert each.high[ERROR].max() == truth.max()


def test_zoomed_in_every_row_is_there(path: Path, truth: np.ndarray) -> None:
    told = signals(OpenedLog(path), [ERROR], 24.6, 24.8, 800)
    assert told.told["every_row"]
    rows = slice(24 * 5000 + 3000 - 1, 24 * 5000 + 4000 + 1)
    assert told.arrays[ERROR] == pytest.approx(truth[rows])


@pytest.mark.parametrize("pixels", [100, 2000])
def test_where_rows_are_missing_the_line_is_interrupted(tmp_path: Path, pixels: int) -> None:
    ticks = np.concatenate((np.arange(1000), np.arange(3000, 4000)))
    write_log(tmp_path / "gap.parquet", make_rows(2000, ticks=ticks), {"rate_hz": 1000.0})
    told = signals(OpenedLog(tmp_path / "gap.parquet"), [ERROR], 0.0, 4.0, pixels)
    (hole,) = np.flatnonzero(np.isnan(told.arrays[ERROR]))
    assert 0.98 < told.arrays["time_s"][hole] < 1.01
    assert (np.diff(told.arrays["time_s"]) > 0).all()


def test_a_column_in_rows_beyond_the_log_is_what_there_is(path: Path, truth: np.ndarray) -> None:
    log = motorctl.open_log(path)
    assert log.part(ERROR, 65_530, 65_550) == pytest.approx(truth[65_530:65_550])
    assert len(log.part(ERROR, ROWS - 3, ROWS + 3)) == 3
    assert len(log.part(ERROR, 10, 5)) == 0
    with pytest.raises(KeyError, match="no column 'z'"):
        log.part("z", 0, 1)


def test_a_log_knows_between_what_its_columns_lie(path: Path, truth: np.ndarray) -> None:
    known = motorctl.open_log(path).extremes(ERROR)
    assert known.begins.tolist() == [0, 65_536, 131_072, 196_608]
    assert known.high[1] == truth[65_536:131_072].max()
    assert known.low[3] == truth[196_608:].min()


def test_a_log_of_several_parts_begins_with_its_first_row_and_ends_with_its_last(
    path: Path,
) -> None:
    opened = OpenedLog(path)
    assert (opened.begin_s(), opened.end_s()) == pytest.approx((0.0, (ROWS - 1) / RATE_HZ))
