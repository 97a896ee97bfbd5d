"""The uniform grid of samples that a recording is brought onto.

A log counts its ticks, so what it skipped is known. The times of a foreign file tell it: steps of
whole periods are a hole, other steps are uneven sampling or clocks that were read late (see
`uneven_times`). What was not recorded is filled in and marked, so that nothing is judged by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.between_samples import smooth_between
from motorctl.log.long_holes import require_stretches
from motorctl.log.table import Table
from motorctl.log.uneven_times import (
    counted_ticks,
    is_even_by_index,
    longest_step,
    usual_step,
    with_holes_in_place,
)

Array = NDArray[np.float64]
Ticks = NDArray[np.int64]
Gaps = Literal["fill", "keep"]

MINIMUM_ROWS = 16
MOST_TICKS_FILLED = 10
"""A longer gap is not interpolated over: too much would be invented."""
TOLERANCE_PERIODS = 0.25
"""How far a time may lie off the uniform grid."""
RATE_AGREEMENT = 1e-7
"""Of the rate that times show and the one that the log names: then it is that one."""
SIGNIFICANT_DIGITS = 9
HIGHEST_RATE_HZ = 1e8
LONGEST_PERIOD_S = 1e5
LARGEST_TICK = 1 << 53


@dataclass(frozen=True)
class Grid:
    """Uniform samples, and how to get there from the rows of a file.

    The rows that are taken lie at `_ticks`, whole numbers of periods, or where samples are uneven
    at any place between them.
    """

    sample_rate_hz: float
    time_s: Array
    notes: tuple[str, ...]
    rows_filled: int
    _rows: slice
    _ticks: Ticks | Array
    """The place of each row taken, in periods from 0."""
    recorded: NDArray[np.bool_] | None = None
    """Which samples were recorded, or stand between two that were, and not filled in; None: all."""
    resampled: bool = False
    bridged: int = 0
    """Missing samples that count as recorded, as both neighbours were."""

    @property
    def _as_it_is(self) -> bool:
        return self.rows_filled == 0 and not self.resampled

    def floats(self, values: Array, held: bool = False) -> Array:
        """Bring a column of the file onto the grid, linearly over what is filled.

        Of uneven samples, and where single ones are missing, a smooth column is interpolated by
        cubics; of one that is `held` between samples, as a command, each uneven period has the
        mean.
        """
        taken = values[self._rows]
        if self._as_it_is:
            return taken.copy()
        grid = np.arange(len(self.time_s))
        if held and self.resampled:
            return self._mean_held(taken)
        straight = np.interp(grid, self._ticks, taken)
        if held or not (self.resampled or self.bridged):
            return straight
        smooth = smooth_between(self._ticks.astype(np.float64), taken, grid.astype(np.float64))
        return smooth if self.recorded is None else np.where(self.recorded, smooth, straight)

    def measured(self, values: Array) -> Array:
        """Bring a column onto the grid, NaN where it is filled."""
        taken = values[self._rows]
        if self._as_it_is:
            return taken.copy()
        if self.resampled:
            brought = taken[self._before(np.arange(len(self.time_s)))]
            return brought if self.recorded is None else np.where(self.recorded, brought, np.nan)
        out = np.full(len(self.time_s), np.nan)
        out[self._ticks.astype(np.int64)] = taken
        return out

    def integers(self, values: Array) -> NDArray[np.int64]:
        """Bring a column of codes onto the grid; filled rows repeat the one before."""
        taken = values[self._rows].astype(np.int64)
        return taken if self._as_it_is else taken[self._before(np.arange(len(self.time_s)))]

    def recorded_without(
        self, blanks: Sequence[NDArray[np.bool_] | None]
    ) -> NDArray[np.bool_] | None:
        """Return which samples rest on nothing blank or filled in; None: all."""
        found = self.recorded
        for blank in blanks:
            if blank is not None:
                whole = self.floats(blank.astype(np.float64), held=True) == 0.0
                found = whole if found is None else found & whole
        return found

    def _mean_held(self, taken: Array) -> Array:
        """Return the mean over each period of what is held from one row to the next."""
        spans = np.diff(self._ticks, append=self._ticks[-1] + 1.0)
        integral = np.concatenate([[0.0], np.cumsum(taken * spans)])
        edges = np.concatenate([self._ticks, [self._ticks[-1] + 1.0]])
        at = np.interp(np.arange(len(self.time_s) + 1), edges, integral)
        return np.asarray(np.diff(at))

    def _before(self, grid: Ticks) -> Ticks:
        """Return the row at or before each sample."""
        return np.maximum(np.searchsorted(self._ticks, grid + 1e-6, side="right") - 1, 0)


def grid_of_rate(table: Table, rows: int, sample_rate_hz: float) -> Grid:
    """Make the grid of a file without times, whose rate is known."""
    _require_rows(table, rows)
    time_s = np.arange(rows) / sample_rate_hz
    return Grid(sample_rate_hz, time_s, (), 0, slice(None), np.arange(rows))


def grid_of_time(
    table: Table,
    time_column: str,
    time_s: Array,
    tick: Array | None = None,
    nominal_rate_hz: float | None = None,
    gaps: Gaps = "fill",
    motion: Sequence[Array] = (),
) -> Grid:
    """Make the grid of a file with a column of times.

    Parameters
    ----------
    table
        The file, for messages.
    time_column, time_s
        Name and values of the column; [s], shape (N,).
    tick
        The file's count of periods, shape (N,); None where it has none. With it, skipped periods
        are known and legitimate.
    nominal_rate_hz
        The rate that the file tells of; None where it tells none.
    gaps
        "fill": gaps up to MOST_TICKS_FILLED are filled and the longest stretch without a longer one
        is taken. "keep": rows stay as they are and `time_s` is not uniform.
    motion
        Smooth columns, (N,) each, that tell whether uneven times are those of uneven samples.

    Raises
    ------
    DataError
        Where times run backwards, repeat, or have more holes than samples.
    """
    _require_rows(table, len(time_s))
    table.require_finite(time_column, time_s)
    _require_increasing(table, time_column, time_s)
    ticks = np.arange(len(time_s)) if tick is None else _counted(table, tick)
    rate = _rate(table, time_s, ticks, nominal_rate_hz)
    if tick is None and not _is_uniform(time_s, ticks, rate):
        return _of_uneven_times(table, time_column, time_s, motion)
    _require_uniform(table, time_column, time_s, ticks, rate)
    if ticks[-1] == len(ticks) - 1:
        uniform = time_s[0] + np.arange(len(ticks)) / rate
        return Grid(rate, uniform, (), 0, slice(None), ticks)
    missing = int(ticks[-1]) + 1 - len(ticks) - table.left_out
    if gaps == "keep":
        notes = (f"{missing} ticks are missing",) if missing else ()
        return Grid(rate, time_s, notes, 0, slice(None), ticks)
    return _filled(table, time_s, ticks, rate)


def _filled(table: Table, time_s: Array, ticks: Ticks, rate: float) -> Grid:
    steps = np.diff(ticks)
    long = np.flatnonzero(steps > MOST_TICKS_FILLED + 1) + 1
    edges = np.concatenate(([0], long, [len(ticks)]))
    lengths = np.diff(edges)
    best = int(np.argmax(lengths))
    rows = slice(int(edges[best]), int(edges[best + 1]))
    _require_rows(table, rows.stop - rows.start)
    taken = ticks[rows] - ticks[rows.start]
    filled = int(taken[-1]) + 1 - len(taken)
    notes: list[str] = []
    if long.size:
        notes.append(
            f"{long.size} gaps of more than {MOST_TICKS_FILLED} ticks; the longest stretch "
            f"without one is used: {table.row(rows.start)} to {rows.stop} of {len(ticks)}"
        )
    if filled:
        notes.append(f"{filled} skipped ticks of {int(taken[-1]) + 1} are filled in linearly")
    return _with_holes(rate, float(time_s[rows.start]), notes, rows, taken, bridge=False)


def _with_holes(
    rate: float, begin_s: float, notes: Sequence[str], rows: slice, ticks: Ticks, bridge: bool
) -> Grid:
    """Make the grid of rows that lie at whole periods, some of which are missing.

    bridge has single missing ones count as recorded: else they would cut a motion into pieces.
    """
    count = int(ticks[-1]) + 1
    recorded = np.zeros(count, dtype=np.bool_)
    recorded[ticks] = True
    single = ticks[:-1][np.diff(ticks) == 2] + 1 if bridge else ticks[:0]
    recorded[single] = True
    uniform = begin_s + np.arange(count) / rate
    filled = count - len(ticks)
    return Grid(rate, uniform, tuple(notes), filled, rows, ticks, recorded, bridged=len(single))


def _of_uneven_times(table: Table, name: str, time_s: Array, motion: Sequence[Array]) -> Grid:
    """Make the grid of times that are not uniform: holes, late clocks or uneven samples."""
    usual = usual_step(time_s)
    steps = np.diff(time_s) / usual
    ticks = counted_ticks(time_s, usual)
    rate = _rate(table, time_s, ticks, None)
    missing = int(ticks[-1]) + 1 - len(ticks)
    if missing > len(ticks):
        require_stretches(table, name, time_s, missing)
    exact = _is_uniform(time_s, ticks, rate)
    if exact or is_even_by_index(ticks, time_s, usual, motion):
        notes = []
        if not exact:
            single = steps / np.diff(ticks)
            notes.append(
                f"the times step by {1e3 * usual * single.min():.3g} to "
                f"{1e3 * usual * single.max():.3g} ms a sample, which the position does not show: "
                f"its samples are taken as uniform, at {rate:g} Hz"
            )
            ticks = with_holes_in_place(ticks, motion)
        grid = _with_holes(rate, float(time_s[0]), notes, slice(None), ticks, bridge=True)
        if grid.bridged:
            notes.append(
                f"{grid.bridged} single samples of {len(grid.time_s)} are missing: interpolated"
            )
        if missing > grid.bridged:
            notes.append(
                f"{missing - grid.bridged} samples of {len(grid.time_s)} were not recorded: filled "
                "in for the time base, and left out of every judgement"
            )
        return replace(grid, notes=tuple(notes))
    return _resampled(time_s, steps, usual)


def _resampled(time_s: Array, steps: Array, usual: float) -> Grid:
    """Make the grid of uneven samples, at their mean rate where there is no hole."""
    rate = float(f"{1.0 / usual:.6g}")
    holes = np.flatnonzero(steps > longest_step(time_s) / usual)
    places = (time_s - time_s[0]) * rate
    count = int(places[-1]) + 1
    recorded = np.ones(count, dtype=np.bool_)
    for k in holes:
        recorded[int(places[k]) + 1 : int(np.ceil(places[k + 1]))] = False
    filled = int(np.count_nonzero(~recorded))
    notes = [
        f"samples are uneven ({1e3 * usual * np.percentile(steps, 1):.3g} to "
        f"{1e3 * usual * np.percentile(steps, 99):.3g} ms apart): brought to {rate:g} Hz, smooth "
        "columns by cubics, commands as they were held"
    ]
    if filled:
        notes.append(
            f"{len(holes)} holes: {filled} samples of {count} are left out of every judgement"
        )
    uniform = time_s[0] + np.arange(count) / rate
    return Grid(
        rate, uniform, tuple(notes), filled, slice(None), places, recorded if filled else None, True
    )


def _require_rows(table: Table, rows: int) -> None:
    if rows < MINIMUM_ROWS:
        raise DataError(f"{table.path}: it has {rows} rows; at least {MINIMUM_ROWS} are needed")


def _require_increasing(table: Table, name: str, values: NDArray[Any]) -> None:
    steps = np.diff(values)
    wrong = np.flatnonzero(steps <= 0)
    if not wrong.size:
        return
    k = int(wrong[0]) + 1
    repeats = steps[k - 1] == 0
    what = "repeats" if repeats else "runs backwards:"
    more = f"; {wrong.size} of {len(values)} rows do not come after the one before"
    raise DataError(
        f"{table.path}: {table.row(k)}: column '{name}' {what} "
        f"{values[k]:.9g} after {values[k - 1]:.9g}{more if wrong.size > 1 else ''}"
        f"{_way_out(values) if repeats and name != 'tick' else ''}"
    )


def _way_out(time_s: Array) -> str:
    """Return what to do with times of which some are the same."""
    steps = np.diff(time_s)
    run = steps[steps <= longest_step(time_s)]
    rate = len(run) / float(run.sum()) if run.sum() > 0.0 else 0.0
    on_average = ""
    if 0.0 < rate < HIGHEST_RATE_HZ:
        on_average = f": {rate:.6g}, its rows over its time but for pauses,"
    return (
        ": the clock has too few digits, or rows were written twice. Where samples are evenly "
        f"spaced, describe the file in YAML with sample_rate_hz{on_average} in place of time; else "
        "take the rows out that stand twice"
    )


def _counted(table: Table, tick: Array) -> Ticks:
    table.require_finite("tick", tick)
    wrong = np.flatnonzero((tick != np.rint(tick)) | (np.abs(tick) > LARGEST_TICK))
    if wrong.size:
        k = int(wrong[0])
        raise DataError(
            f"{table.path}: {table.row(k)}: column 'tick' is {tick[k]:g}; must be a whole number"
        )
    _require_increasing(table, "tick", tick)
    ticks = tick.astype(np.int64)
    return ticks - int(ticks[0])


def _rate(table: Table, time_s: Array, ticks: Ticks, nominal_rate_hz: float | None) -> float:
    rate = float(ticks[-1]) / (float(time_s[-1]) - float(time_s[0]))
    if not 1.0 / LONGEST_PERIOD_S < rate < HIGHEST_RATE_HZ:
        raise DataError(
            f"{table.path}: {rate:.3g} samples a second; should be between "
            f"{1.0 / LONGEST_PERIOD_S:g} and {HIGHEST_RATE_HZ:g}: is the unit of time right?"
        )
    if nominal_rate_hz and abs(rate / nominal_rate_hz - 1) < RATE_AGREEMENT:
        return nominal_rate_hz
    return float(f"{rate:.{SIGNIFICANT_DIGITS}g}")


def _is_uniform(time_s: Array, ticks: Ticks, rate: float) -> bool:
    return bool(np.max(np.abs(_off(time_s, ticks, rate))) <= TOLERANCE_PERIODS)


def _off(time_s: Array, ticks: Ticks, rate: float) -> Array:
    """Return how far times lie off the uniform grid, in periods."""
    return np.asarray((time_s - time_s[0]) * rate - ticks)


def _require_uniform(table: Table, name: str, time_s: Array, ticks: Ticks, rate: float) -> None:
    if _is_uniform(time_s, ticks, rate):
        return
    off = _off(time_s, ticks, rate)
    worst = int(np.argmax(np.abs(off)))
    steps = np.diff(time_s) / np.diff(ticks)
    usual = float(np.median(steps))
    odd = np.flatnonzero(np.abs(steps / usual - 1) > 0.5)
    if odd.size:
        k = int(odd[0]) + 1
        where = f"{table.row(k)}: column '{name}' steps by {steps[k - 1]:.6g} s"
        usually = f"elsewhere by {usual:.6g} s ({odd.size} such steps)"
    else:
        where = f"{table.row(worst)}: column '{name}' lies {abs(off[worst]):.2g} periods"
        usually = f"off a uniform grid (limit {TOLERANCE_PERIODS})"
    raise DataError(
        f"{table.path}: {where}, {usually}; samples must be uniform: resample the file, or "
        "describe it in YAML with sample_rate_hz where only the times are inexact"
    )
