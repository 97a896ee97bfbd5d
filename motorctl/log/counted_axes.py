"""Count on in an axis' position and reference where they begin anew, and only where they do.

A motion that flies back within a sample looks like a counter that begins anew. So a column goes on
only where that is plain, or the description tells what it begins anew after.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.description import AxisDescription, Description, PositionColumn
from motorctl.log.table import Table
from motorctl.log.turns import (
    BEYOND,
    NEAR_TURN,
    TURN_RAD,
    WRAPS,
    Jumps,
    counted_on,
    is_of_a_bus,
    is_sure,
    jumps_of,
    period_of,
    power_of_two,
)

Array = NDArray[np.float64]

NEARER = 0.5
"""Part of a period from which a step is a jump where the period is told. Arithmetic: a larger step
is nearer to one."""
FOLLOWS = 0.5
"""Part of a period that a position which is counted on stays near a reference that goes on: then it
is a counter. Arithmetic: further off it is nearer to another period."""


class _Given(NamedTuple):
    """A column of positions without its blanks."""

    key: str
    """Where the description tells it."""
    described: PositionColumn
    values: Array
    """(M,), finite."""
    rows: NDArray[np.intp]
    """The row of each, (M,)."""

    @property
    def turn(self) -> float | None:
        """One turn in the column's unit; None: a length."""
        factor = abs(self.described.factor)
        return TURN_RAD / factor if self.described.base_unit == "rad" else None

    @property
    def counts(self) -> bool:
        return self.described.unit == "count"

    @property
    def span(self) -> float:
        return float(np.ptp(self.values)) if len(self.values) else 0.0


class _Counted(NamedTuple):
    """What came of one column."""

    values: Array
    period: float
    """What it begins anew after, in its unit; 0: not known, or it does not."""
    jumps: int = 0
    note: str = ""


def with_turns_counted(
    table: Table, columns: Mapping[str, Array], description: Description, path: Path
) -> tuple[dict[str, Array], list[str]]:
    """Return columns in which positions and references of a counter go on, and notes.

    Parameters
    ----------
    table
        The file, for messages.
    columns
        Every column that the description names, (N,) each; a blank is NaN, and stays one.
    description
        Which of them is what.
    path
        Of the description, for messages.

    Raises
    ------
    DataError
        Where a column reaches beyond the period that is told.
    """
    out, notes = dict(columns), []
    for name, axis in description.axes.items():
        found = _counted_axis(table, columns, name, axis, path)
        for given, counted in found:
            if counted.jumps or not np.array_equal(counted.values, given.values):
                placed = np.full(len(columns[given.described.column]), np.nan)
                placed[given.rows] = counted.values
                out[given.described.column] = placed
            if counted.note:
                notes.append(f"axis {name}: column '{given.described.column}' {counted.note}")
    return out, notes


def _counted_axis(
    table: Table, columns: Mapping[str, Array], name: str, axis: AxisDescription, path: Path
) -> list[tuple[_Given, _Counted]]:
    def given(signal: str, described: PositionColumn | None) -> _Given | None:
        if described is None:
            return None
        values = columns[described.column]
        table.without_blanks(described.column, values)  # refuses what cannot be used
        rows = np.flatnonzero(~np.isnan(values))
        found = _Given(f"axes.{name}.{signal}.period", described, values[rows], rows)
        told = described.period
        if told and found.span > (1.0 + BEYOND) * told:
            raise DataError(
                f"{path}: {found.key}: {told:g} {described.unit}, but column '{described.column}' "
                f"spans {found.span:.6g}; should be what it begins anew after, or 0 where it "
                "does not"
            )
        return found

    position, reference = given("position", axis.position), given("reference", axis.reference)
    out: list[tuple[_Given, _Counted]] = []
    counted = None if position is None else _counted_position(position, reference)
    if position is not None and counted is not None:
        out.append((position, counted))
    if reference is not None:
        out.append((reference, _counted_reference(reference, position, counted)))
    return _aligned(out) if len(out) > 1 else out


def _counted_position(given: _Given, reference: _Given | None) -> _Counted:
    period = given.described.period
    if period is not None:
        return _counted(given, period)
    jumps = jumps_of(given.values, given.turn)
    if jumps is None:
        return _Counted(given.values, 0.0)
    period = period_of(given.values, jumps, given.turn, given.counts)
    if why := _why_not(given, reference, jumps, period):
        note = (
            f"jumps from one end to the other {len(jumps.rows)} times, by about {jumps.after:.6g} "
            f"{given.described.unit}, and is left as it is: {why}. Where it is a counter, "
            f"{given.key} should be what it begins anew after; 0 where it is none"
        )
        return _Counted(given.values, 0.0, note=note)
    return _counted(given, period)


def _why_not(given: _Given, reference: _Given | None, jumps: Jumps, period: float) -> str:
    """Return why jumps are not plainly those of a counter; nothing where they are."""
    if jumps.of_turn:
        return ""
    if reference is not None and _goes_on_beside(given, reference, period):
        return ""
    if not is_sure(jumps):
        return "what it would begin anew after is not sure"
    if given.turn is not None and not given.counts and period < (1.0 - NEAR_TURN) * given.turn:
        return "that is less than a turn"
    speaks_for_it = [
        jumps.both_ways,  # what flies back does so one way
        power_of_two(given.values, jumps, given.counts) is not None,
        given.turn is not None and period > given.turn and is_of_a_bus(given.values, period),
    ]
    if reference is not None and _jumps_along(given, jumps, reference):
        if sum(speaks_for_it) < 2:
            return "the reference jumps with it, as in a motion that flies back"
    elif not any(speaks_for_it):
        return "a motion that flies back within a sample does the same"
    return ""


def _jumps_along(given: _Given, jumps: Jumps, reference: _Given) -> bool:
    """Return whether each jump is as many rows behind one of the reference.

    Two counters begin anew in the same row or in neighbouring ones, as it comes.
    """
    its = jumps_of(reference.values, reference.turn)
    if its is None:
        return False
    mine, sent = given.rows[jumps.rows], reference.rows[its.rows]
    inside = (mine >= sent[0]) & (mine <= sent[-1])  # a recording may begin or end between two
    mine = mine[inside] if inside.any() else mine
    behind = np.searchsorted(sent, mine)
    before, after = np.maximum(behind - 1, 0), np.minimum(behind, len(sent) - 1)
    lags = np.stack([mine - sent[before], mine - sent[after]])
    nearest = np.where(np.abs(lags[0]) < np.abs(lags[1]), lags[0], lags[1])
    return bool(np.ptp(nearest) == 0)


def _goes_on_beside(given: _Given, reference: _Given, period: float) -> bool:
    """Return whether the reference goes further than a period, and what is counted on follows."""
    rows, mine, its = np.intersect1d(given.rows, reference.rows, return_indices=True)
    if not rows.size:
        return False
    one = abs(given.described.factor) * period
    sent = reference.values[its] * reference.described.factor
    if np.ptp(sent) < (1.0 + FOLLOWS) * one:
        return False
    on = counted_on(given.values, period)[0][mine] * given.described.factor
    return bool(np.ptp(on - sent) < FOLLOWS * one)


def _counted_reference(
    given: _Given, position: _Given | None, counted: _Counted | None
) -> _Counted:
    """Return the reference with the position's period; alone it goes on after a turn only."""
    period = given.described.period
    if period is not None:
        return _counted(given, period)
    if position is not None and counted is not None:
        if counted.period:
            factor = abs(position.described.factor / given.described.factor)
            period = factor * counted.period
            return (
                _counted(given, period)
                if given.span <= (1.0 + BEYOND) * period
                else _as_it_is(given)
            )
        if position.described.period is not None or counted.note:
            return _as_it_is(given)
    jumps = jumps_of(given.values, given.turn)
    if jumps is None or not jumps.of_turn:
        return _as_it_is(given)  # may be a saw's teeth
    return _counted(given, given.turn or 0.0)


def _as_it_is(given: _Given) -> _Counted:
    return _Counted(given.values, 0.0)


def _counted(given: _Given, period: float) -> _Counted:
    if period == 0.0:
        return _as_it_is(given)
    told = given.described.period is not None
    values, jumps = counted_on(given.values, period, NEARER if told else WRAPS)
    if not jumps:
        return _Counted(values, period)
    a_turn = given.turn is not None and period == given.turn and not told
    note = (
        f"begins anew after {'a turn' if a_turn else f'{period:.10g} {given.described.unit}'}, "
        f"{'once' if jumps == 1 else f'{jumps} times'}: "
        f"{'whole turns are' if a_turn else 'it is'} counted on"
        + ("" if told else f" ({given.key}: 0 leaves it as it is)")
    )
    return _Counted(values, period, jumps, note)


def _aligned(pair: list[tuple[_Given, _Counted]]) -> list[tuple[_Given, _Counted]]:
    """Return position and reference, of which one was moved by whole periods to be near the other.

    The two may begin on either side of where they begin anew. Only what was counted on is moved.
    """
    (position, moved), (reference, sent) = pair
    if not (moved.jumps or sent.jumps):
        return pair
    one = abs(position.described.factor) * moved.period
    one = one or abs(reference.described.factor) * sent.period
    _, mine, its = np.intersect1d(position.rows, reference.rows, return_indices=True)
    if not mine.size:
        return pair
    ahead = (
        moved.values[mine] * position.described.factor
        - sent.values[its] * reference.described.factor
    )
    off = float(np.rint(np.median(ahead) / one)) * one
    if sent.jumps:
        sent = sent._replace(values=sent.values + off / reference.described.factor)
    elif np.ptp(ahead) < FOLLOWS * one:
        moved = moved._replace(values=moved.values - off / position.described.factor)
    return [(position, moved), (reference, sent)]
