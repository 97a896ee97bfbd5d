"""First rows of a recording that are values from before it are left out, and refuse nothing."""

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.errors import DataError
from motorctl.identify.columns.frozen_position import check_encoder, without_stale_start
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.fit.recording import fit_axis

REST_S = 1.5
STALE = 20
"""Rows: 4 ms."""


@pytest.fixture(scope="module")
def run():
    """An axis that rests first, as its command is below its dry friction."""
    sound = OtherPlant(width_m_s=2e-3).run(seed=3, duration_s=7.0)
    rest = round(REST_S * sound.sample_rate_hz)
    position = np.r_[np.full(rest, sound.position[0]), sound.position]
    return replace(
        sound, time_s=sound.period_s * np.arange(len(position)), position=position,
        command=np.r_[np.linspace(0.0, 0.01, rest), sound.command], reference=None,
        reference_velocity=None, saturated=None, usable=np.ones(len(position), dtype=bool),
    )  # fmt: skip


def moving_before(run, rows):
    """Return the axis as if it moved at full speed in its first rows, and stood at once."""
    step = np.abs(np.diff(run.position)).max()
    position = run.position.copy()
    position[:rows] -= step * np.arange(rows, 0, -1)
    return replace(run, position=position)


def test_a_few_first_rows_of_a_motion_that_never_ends_are_left_out_and_told(run):
    data, note = without_stale_start(moving_before(run, STALE))
    assert note.startswith("the first 20 rows are left out")
    assert "stands still for 1.5 s" in note
    np.testing.assert_array_equal(np.flatnonzero(~data.usable), range(STALE))
    check_encoder(data)


def test_a_recording_that_begins_at_rest_keeps_its_first_rows(run):
    data, note = without_stale_start(run)
    assert note is None
    assert data.usable.all()


def test_a_longer_motion_before_the_freeze_is_told_as_before(run):
    rows = round(0.3 * run.sample_rate_hz)
    data, note = without_stale_start(moving_before(run, rows))
    assert note is None
    with pytest.raises(DataError, match=r"the position freezes at 0\.3 s") as refusal:
        check_encoder(data)
    begin_s, end_s = str(refusal.value).rpartition("fit: [")[2].rstrip("]})").split(", ")
    assert float(begin_s) == pytest.approx(REST_S, abs=0.1)  # the longer part is kept
    assert float(end_s) == pytest.approx(run.time_s[-1])


def test_no_part_that_is_too_short_is_recommended(run):
    rows, stop = round(0.15 * run.sample_rate_hz), round(20.0 * run.sample_rate_hz)
    position = np.concatenate([1e-4 * np.arange(rows), np.full(stop - rows, 1e-4 * rows)])
    data = replace(
        run, time_s=run.period_s * np.arange(stop), position=position,
        command=np.zeros(stop), usable=np.ones(stop, dtype=bool),
    )  # fmt: skip
    with pytest.raises(DataError, match=r"0\.15 s beside it are too few .*record the motion anew"):
        check_encoder(data)


@pytest.mark.slow
def test_an_answer_is_that_of_the_rows_behind_stale_ones(run):
    damaged, sound = (
        moving_before(run, STALE),
        replace(run, usable=np.arange(len(run.usable)) >= STALE),
    )
    diagnosed, fitted = diagnose_axis(damaged, C1), fit_axis(damaged, C1)
    assert diagnosed.verdict == diagnose_axis(sound, C1).verdict
    np.testing.assert_allclose(fitted.theta, fit_axis(sound, C1).theta)
    for answer in (diagnosed, fitted):
        assert any("first 20 rows" in note for note in answer.notes)
