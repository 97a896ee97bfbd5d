"""What a capture begins with is looked for in every row, however the rows come."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from recorded_rows import AXES, make_rows

from motorctl.api.samples import Samples
from motorctl.errors import UsageError
from motorctl.log.columns import log_columns
from motorctl.log.sample import AxisState
from motorctl.scope.history import History
from motorctl.scope.trigger import Trigger, Watch

COLUMNS = {column.name: column for column in log_columns(AXES)}
METADATA = {"rate_hz": 1000.0}
Rows = tuple[np.ndarray, np.ndarray]


def samples(rows: Rows, first: int = 0, last: int | None = None) -> Samples:
    part = slice(first, last)
    return Samples(rows[0][part], rows[1][part], COLUMNS, 0, 0, AXES, METADATA)


def found(trigger: Trigger, rows: Rows, cuts: list[int]) -> list[int]:
    """Return the rows of the whole that trigger, where rows come in pieces."""
    watch = Watch(trigger, samples(rows, 0, 0))
    ends = sorted({*(cut for cut in cuts if cut < len(rows[0])), len(rows[0])})
    found, begin = [], 0
    for end in ends:
        found += (begin + watch.find(samples(rows, begin, end))).tolist()
        begin = end
    return found


def crossings(values: list[int], level: float, hysteresis: float) -> list[int]:
    """Return what a person would say, row by row."""
    ready, found = False, []
    for k, value in enumerate(values):
        if ready and value >= level:
            found.append(k)
            ready = False
        ready = ready or value < level - hysteresis
    return found


@given(
    values=st.lists(st.integers(-4, 4), min_size=1, max_size=40),
    cuts=st.lists(st.integers(1, 40), max_size=5),
    hysteresis=st.integers(0, 3),
    falling=st.booleans(),
)
def test_a_level_is_crossed_each_time_that_it_was_further_back_than_the_hysteresis(
    values: list[int], cuts: list[int], hysteresis: int, falling: bool
) -> None:
    rows = make_rows(len(values))
    rows[1]["command_v"][:, 0] = values
    trigger = Trigger(
        kind="level",
        column="x.command_v",
        level=1.0,
        hysteresis=hysteresis,
        edge="falling" if falling else "rising",
    )
    sign = -1 if falling else 1
    expected = crossings([sign * value for value in values], sign * 1.0, hysteresis)
    assert found(trigger, rows, cuts) == expected


def test_a_level_triggers_again_only_after_it_went_back() -> None:
    rows = make_rows(12)
    rows[1]["command_v"][:, 0] = [0, 5, 5, 5, 5, 5, 0, 0, 5, 5, 0, 5]
    trigger = Trigger(kind="level", column="x.command_v", level=3.0, hysteresis=1.0)
    watch = Watch(trigger, samples(rows, 0, 0))
    pieces = [watch.find(samples(rows, begin, begin + 3)) for begin in range(0, 12, 3)]
    assert [piece.tolist() for piece in pieces] == [[1], [], [2], [2]]


@pytest.mark.parametrize(
    ("kind", "axis", "found_in"),
    [
        ("fault", None, [70]),
        ("fault", "x", []),
        ("state", None, [30, 50, 70]),
        ("program", "y", [50]),
    ],
)
@pytest.mark.parametrize("cuts", [[], [30], [31, 50, 70], list(range(1, 100))])
def test_a_fault_a_change_and_a_start_are_found_in_their_row(
    kind: str, axis: str | None, found_in: list[int], cuts: list[int]
) -> None:
    rows = make_rows(100)
    rows[1]["state"][:30] = AxisState.OFF
    rows[1]["state"][30:50] = AxisState.IDLE
    rows[1]["state"][70:, 1] = AxisState.FAULT
    assert found(Trigger(kind=kind, axis=axis), rows, cuts) == found_in  # type: ignore[arg-type]


def test_what_cannot_trigger_is_refused() -> None:
    like = samples(make_rows(1))
    with pytest.raises(UsageError, match="axis: 'z'; there are: x, y"):
        Watch(Trigger(kind="fault", axis="z"), like)
    with pytest.raises(UsageError, match=r"column: 'x\.warp' is none"):
        Watch(Trigger(kind="level", column="x.warp"), like)
    for wrong in ({"kind": "level"}, {"kind": "fault", "column": "tick"}, {"kind": "moon"}):
        with pytest.raises(ValidationError):
            Trigger.model_validate(wrong)
    with pytest.raises(ValidationError, match="less than or equal to 30"):
        Trigger(kind="fault", pre_s=31)


@given(sizes=st.lists(st.integers(0, 90), max_size=30))
def test_the_newest_rows_are_kept_in_their_order(sizes: list[int]) -> None:
    rows = make_rows(max(1, sum(sizes)))
    history = History(samples(rows, 0, 0), kept_s=0.1)
    done = 0
    for size in sizes:
        history.add(samples(rows, done, done + size))
        done += size
        kept = min(done, 100)
        assert (history.rows, history.dropped) == (kept, done - kept)
        assert history.part("tick", 0, 1000).tolist() == list(range(done - kept, done))
        assert (
            history.part("y.position_m", 0, 1000) == rows[1]["position_m"][done - kept : done, 1]
        ).all()


def test_rows_that_are_the_first_of_all_trigger_only_where_something_changes_in_them() -> None:
    ticks, rows = make_rows(20)
    rows["state"][:10] = AxisState.OFF
    rows["state"][10:] = AxisState.IDLE
    first = samples((ticks, rows))
    assert Watch(Trigger(kind="state"), first, begins=True).find(first).tolist() == [10]
