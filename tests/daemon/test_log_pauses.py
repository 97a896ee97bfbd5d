"""No rows while every axis is off, where the configuration says so; what reads logs copes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import settings as trying
from hypothesis import strategies as st
from recorded_ring import Ring, finished, metadata_of, ring, rotating, settings, ticks_of

from motorctl.daemon.pauses import PausesWhileOff
from motorctl.log import read_recording
from motorctl.log.sample import TICK_SAMPLE, AxisState, axis_sample

PAUSING = settings(while_off="pause")


@pytest.fixture
def bench() -> Iterator[Ring]:
    with ring() as made:
        yield made


def recorded(bench: Ring, log, states: list[tuple[float, AxisState]]) -> None:
    for seconds, state in states:
        for _ in range(round(seconds)):
            bench.run(1000, state)
            log.append(*bench.take())


def test_rows_while_every_axis_is_off_are_left_out_and_told(bench: Ring, tmp_path: Path) -> None:
    log = rotating(tmp_path, PAUSING, lambda _: None)
    recorded(bench, log, [(3, AxisState.RUNNING), (10, AxisState.OFF)])
    assert log.paused
    recorded(bench, log, [(2, AxisState.IDLE)])
    assert not log.paused
    path = log.close({"rows_lost": 0})
    # The second after the last axis went off shows how it came to rest.
    assert ticks_of([path]).tolist() == [*range(4000), *range(13_000, 15_000)]
    pauses = metadata_of(path)["pauses"]
    assert pauses["count"] == 1
    assert pauses["last"] == [
        {"after_tick": 3999, "before_tick": 13_000, "from_s": 3.999, "to_s": 13.0}
    ]
    assert pauses["seconds"] == pytest.approx(9.001)
    assert log.rows_lost == 0


def test_without_the_key_every_row_is_recorded(bench: Ring, tmp_path: Path) -> None:
    log = rotating(tmp_path, settings(), lambda _: None)
    recorded(bench, log, [(5, AxisState.OFF)])
    path = log.close({})
    assert len(ticks_of([path])) == 5000
    assert "pauses" not in metadata_of(path)


@pytest.mark.parametrize("state", [s for s in AxisState if s is not AxisState.OFF])
def test_one_axis_that_is_not_off_is_enough(state: AxisState) -> None:
    """A fault is not off: what happens to a machine in fault is recorded."""
    samples = np.zeros((5000, 2), axis_sample(1))
    samples["state"] = AxisState.OFF
    samples["state"][4000:, 1] = state
    recorded = PausesWhileOff().rows_to_record(_ticks(0, 5000), samples)
    assert recorded[4000:].all()
    assert not recorded[1500:4000].any()


def _ticks(first: int, last: int) -> np.ndarray:
    ticks = np.zeros(last - first, TICK_SAMPLE)
    ticks["tick"] = np.arange(first, last)
    ticks["time_s"] = ticks["tick"] / 1000
    return ticks


@trying(max_examples=40)
@given(
    spans=st.lists(st.tuples(st.booleans(), st.integers(1, 3000)), min_size=1, max_size=8),
    chunk=st.integers(1, 2500),
)
def test_what_is_left_out_does_not_depend_on_how_the_rows_came(
    spans: list[tuple[bool, int]], chunk: int
) -> None:
    on = np.concatenate([np.full(rows, state) for state, rows in spans])
    samples = np.zeros((len(on), 1), axis_sample(1))
    samples["state"][:, 0] = np.where(on, AxisState.RUNNING, AxisState.OFF)
    ticks = _ticks(0, len(on))
    whole = PausesWhileOff()
    expected = whole.rows_to_record(ticks, samples)
    pieces = PausesWhileOff()
    found = [
        pieces.rows_to_record(ticks[k : k + chunk], samples[k : k + chunk])
        for k in range(0, len(on), chunk)
    ]
    assert np.concatenate(found).tolist() == expected.tolist()
    told = whole.take()
    assert told == pieces.take()
    steps = np.diff(ticks["tick"][expected])
    assert told["pauses"]["count"] == np.count_nonzero(steps > 1)
    assert expected[on].all()


def test_a_pause_outlasts_a_log_and_the_next_one_begins_with_the_motion(
    bench: Ring, tmp_path: Path
) -> None:
    sealed: list[Path] = []
    keys = settings(while_off="pause", rotate={"max_duration_h": 1 / 60})
    log = rotating(tmp_path, keys, sealed.append)
    recorded(bench, log, [(2, AxisState.RUNNING), (100, AxisState.OFF)])
    assert len(sealed) == 1  # closed in time, though no row came
    recorded(bench, log, [(2, AxisState.RUNNING)])
    (first, second) = [*finished(sealed), log.close({})]
    assert ticks_of([first]).tolist() == list(range(3000))
    assert ticks_of([second]).tolist() == list(range(102_000, 104_000))
    assert metadata_of(second)["pauses"]["last"][0]["after_tick"] == 2999


def test_a_log_with_pauses_is_read_from_its_longest_stretch(bench: Ring, tmp_path: Path) -> None:
    log = rotating(tmp_path, PAUSING, lambda _: None)
    recorded(bench, log, [(2, AxisState.RUNNING), (5, AxisState.OFF), (9, AxisState.RUNNING)])
    path = log.close({})
    recording = read_recording(path)
    assert recording.duration_s == pytest.approx(9.0)
    assert any("the longest stretch without one is used" in note for note in recording.notes)
    assert len(read_recording(path, gaps="keep").time_s) == len(pq.read_table(path))
