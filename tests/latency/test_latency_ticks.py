"""Whether every tick is in the log, and what its times were."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from motorctl.latency.loop_run import LoopRun
from motorctl.latency.ticks import TickTimes, read_ticks
from motorctl.log import LogAxis, LogWriter
from motorctl.log.sample import TICK_SAMPLE, SampleFlag, axis_sample

LIMITS_S = (50e-6, 200e-6)


def _log(path: Path, tick: list[int], lateness_us: list[float], flagged: set[int]) -> LoopRun:
    ticks = np.zeros(len(tick), TICK_SAMPLE)
    samples = np.zeros((len(tick), 1), axis_sample(1))
    ticks["tick"], ticks["time_s"] = tick, np.array(tick) * 2e-4
    ticks["lateness_s"] = np.array(lateness_us) * 1e-6
    ticks["turnaround_s"], ticks["read_s"] = 8e-6, 3e-6
    samples["flags"][:, 0] = [SampleFlag.SKIPPED if k in flagged else 0 for k in tick]
    writer = LogWriter(path, {}, [LogAxis("x", ("inertia",))])
    writer.append(ticks, samples)
    skipped = tick[-1] + 1 - len(tick)
    return LoopRun(
        log=writer.close(),
        first_tick=0,
        last_tick=tick[-1],
        ended_at_tick=tick[-1],
        overruns=0,
        skipped_periods=skipped,
        rows_lost=0,
        stolen_share=0.0,
        degraded=[],
        refusals=[],
    )


def _read(run: LoopRun) -> TickTimes:
    return read_ticks(run, "x", LIMITS_S)


def test_contiguous_ticks_are_all_there(tmp_path):
    run = _log(tmp_path / "log.parquet", [0, 1, 2, 3], [0.1, 0.1, 60.0, 0.1], set())
    times = _read(run)
    assert times.every_tick_is_there(run)
    assert times.lateness.total == 4
    assert times.lateness.share_beyond(50e-6) == 0.25
    assert times.lateness.worst_at_s == pytest.approx(4e-4)
    assert times.parts["turnaround"].worst_s == pytest.approx(8e-6)
    assert times.parts["read"].worst_s == pytest.approx(3e-6)
    assert times.skipped_share == 0.0


def test_periods_that_the_loop_skipped_and_counted_are_accounted_for(tmp_path):
    run = _log(tmp_path / "log.parquet", [0, 1, 4, 5], [0.1, 0.1, 420.0, 0.1], {4})
    times = _read(run)
    assert run.skipped_periods == 2
    assert times.every_tick_is_there(run)
    assert times.skipped_share == pytest.approx(2 / 6)


def test_periods_skipped_before_the_first_tick_are_accounted_for(tmp_path):
    run = _log(tmp_path / "log.parquet", [2, 3], [410.0, 0.1], {2})
    assert _read(run).every_tick_is_there(run)


@pytest.mark.parametrize(
    ("tick", "flagged", "changes"),
    [
        ([0, 1, 4, 5], set(), {}),  # a gap that no row tells of
        ([0, 1, 4, 5], {4}, {"skipped_periods": 1}),  # the loop counted less
        ([0, 1, 2, 3], set(), {"rows_lost": 1}),
        ([0, 1, 2, 3], set(), {"ended_at_tick": 4}),  # the last tick is missing
        ([0, 1, 1, 2], set(), {"skipped_periods": 0}),  # a tick stands there twice
    ],
)
def test_a_tick_that_is_missing_is_noticed(tmp_path, tick, flagged, changes):
    run = _log(tmp_path / "log.parquet", tick, [0.1] * len(tick), flagged)
    run = dataclasses.replace(run, **changes)
    assert not _read(run).every_tick_is_there(run)


def test_only_the_window_in_which_the_axes_moved_is_timed(tmp_path):
    run = _log(tmp_path / "log.parquet", [0, 1, 2, 3], [900.0, 1.0, 2.0, 900.0], set())
    run = dataclasses.replace(run, first_tick=1, last_tick=2)
    times = _read(run)
    assert times.lateness.total == 2
    assert times.lateness.worst_s == pytest.approx(2e-6)
    assert times.rows == 4
    assert times.every_tick_is_there(run)
