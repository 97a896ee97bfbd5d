"""A position that stands still, jumps or comes in coarse steps is told as that, with numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.verdict.position_faults import jumps_told, without_stuck
from motorctl.identify.diagnose.verdict.recording_mistakes import check_explains


@pytest.fixture(scope="module")
def run() -> Measured:
    """A sound recording by another author's plant."""
    return OtherPlant(shape="tanh", width_m_s=2e-3).run(seed=3, duration_s=8.0)


def stuck_from_rest(run: Measured) -> tuple[Measured, float]:
    """Return the recording with an encoder that sticks at a reversal, and from when on."""
    velocity = np.gradient(run.position)
    first = int(0.6 * len(velocity))
    at = first + int(np.argmax(velocity[first:-1] * velocity[first + 1 :] <= 0.0))
    position = run.position.copy()
    position[at:] = position[at]
    return replace(run, position=position), float(run.time_s[at])


def heard(data: Measured) -> Hypothesis:
    """Return the declared model over the band in which motion outweighs the noise."""
    return check_explains(data, make_signals(data, slope_s_m=900.0), C1)


def in_counts(run: Measured, counts: int) -> Measured:
    """Return the recording behind an encoder with so many counts over the travel."""
    step = float(np.ptp(run.position)) / counts
    return replace(run, position=np.round(run.position / step) * step, resolution=None)


def test_a_sound_recording_loses_no_rows(run: Measured) -> None:
    data, note = without_stuck(run)
    assert note is None
    assert data is run


@pytest.mark.slow
def test_an_encoder_stuck_from_a_reversal_on_is_left_out_and_told(run: Measured) -> None:
    damaged, at_s = stuck_from_rest(run)
    axis = diagnose_axis(damaged, C1)
    assert axis.verdict == "complete"
    told = next(note for note in axis.notes if "stands still to the last count" in note)
    assert float(told.partition("from ")[2].partition(" s")[0]) == pytest.approx(at_s, abs=2e-2)


def test_a_joint_that_rests_under_another_ones_load_keeps_its_rows(run: Measured) -> None:
    damaged, at_s = stuck_from_rest(run)
    resting = run.time_s >= at_s
    moved = float(np.std(run.command[~resting]))
    load = 0.5 * moved * np.sqrt(2.0) * np.sin(2.0 * np.pi * 0.7 * run.time_s)
    data = replace(damaged, command=np.where(resting, load, run.command))
    assert without_stuck(data)[1] is None


def test_the_end_of_a_sweep_that_the_axis_cannot_follow_is_no_stuck_encoder(run: Measured) -> None:
    damaged, at_s = stuck_from_rest(run)
    resting = run.time_s >= at_s
    quick = float(np.std(run.command)) * np.sqrt(2.0) * np.sin(2.0 * np.pi * 25.0 * run.time_s)
    data = replace(damaged, command=np.where(resting, quick, run.command))
    assert without_stuck(data)[1] is None


def test_missing_rows_are_the_reason_that_is_given(run: Measured) -> None:
    kept = np.arange(len(run.position)) % 2000 < 400  # as of a logger that writes in bursts
    rows = np.flatnonzero(kept)
    glued = Measured(
        source="glued",
        axis="x",
        sample_rate_hz=run.sample_rate_hz,
        time_s=run.time_s[: len(rows)],
        position=run.position[rows],
        command=run.command[rows],
        usable=np.ones(len(rows), dtype=np.bool_),
    )
    with pytest.raises(DataError, match=r"the position jumps \d+ times .* Rows are missing there"):
        heard(glued)


def test_no_jump_is_seen_in_a_sound_or_coarse_recording(run: Measured) -> None:
    assert jumps_told(run) is None
    coarse = replace(run, position=np.round(run.position / 1e-4) * 1e-4)
    assert jumps_told(coarse) is None


@pytest.mark.slow
@pytest.mark.parametrize("counts", [300, 100])
def test_a_sound_axis_behind_a_coarse_encoder_is_told_to_be_behind_one(
    run: Measured, counts: int
) -> None:
    axis = diagnose_axis(in_counts(run, counts), C1)
    assert axis.verdict == "insufficient_data"
    assert not axis.effects
    assert "a finer encoder" in axis.sentence


def test_counts_that_come_seldom_are_heard_below_them(run: Measured) -> None:
    coarse = in_counts(run, 300)
    hypothesis = heard(coarse)
    assert hypothesis.regressors.signals.band_hz < heard(run).regressors.signals.band_hz
    assert hypothesis.b[0] == pytest.approx(heard(run).b[0], rel=0.1)


def test_steps_that_drown_the_motion_are_told_with_those_that_would_not(run: Measured) -> None:
    creeping = 0.2 * np.sin(2.0 * np.pi * 0.15 * run.time_s)
    step = 0.4 / 15.0
    data = replace(run, position=np.round(creeping / step) * step, resolution=None)
    with pytest.raises(DataError, match=r"in steps of 0.0267 m; .* at most .* are needed"):
        heard(data)
