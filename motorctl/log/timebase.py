"""The uniform grid of samples that a recording is brought onto."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.table import Table

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
    """Uniform samples, and how to get there from the rows of a file."""

    sample_rate_hz: float
    time_s: Array
    notes: tuple[str, ...]
    rows_filled: int
    _rows: slice
    _ticks: Ticks
    """The tick of each row taken, from 0."""

    def floats(self, values: Array) -> Array:
        """Bring a column of the file onto the grid, linearly over what is filled."""
        taken = values[self._rows]
        if self.rows_filled == 0:
            return taken.copy()
        return np.interp(np.arange(len(self.time_s)), self._ticks, taken)

    def measured(self, values: Array) -> Array:
        """Bring a column onto the grid, NaN where it is filled."""
        taken = values[self._rows]
        if self.rows_filled == 0:
            return taken.copy()
        out = np.full(len(self.time_s), np.nan)
        out[self._ticks] = taken
        return out

    def integers(self, values: Array) -> NDArray[np.int64]:
        """Bring a column of codes onto the grid; filled rows repeat the one before."""
        taken = values[self._rows].astype(np.int64)
        if self.rows_filled == 0:
            return taken
        before = np.searchsorted(self._ticks, np.arange(len(self.time_s)), side="right") - 1
        return taken[before]


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

    Raises
    ------
    DataError
        Where times run backwards, repeat, or are not uniform.
    """
    _require_rows(table, len(time_s))
    table.require_finite(time_column, time_s)
    _require_increasing(table, time_column, time_s)
    ticks = np.arange(len(time_s)) if tick is None else _counted(table, tick)
    rate = _rate(table, time_s, ticks, nominal_rate_hz)
    _require_uniform(table, time_column, time_s, ticks, rate)
    if tick is None or ticks[-1] == len(ticks) - 1:
        uniform = time_s[0] + np.arange(len(ticks)) / rate
        return Grid(rate, uniform, (), 0, slice(None), ticks)
    missing = int(ticks[-1]) + 1 - len(ticks)
    if gaps == "keep":
        return Grid(rate, time_s, (f"{missing} ticks are missing",), 0, slice(None), ticks)
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
    uniform = time_s[rows.start] + np.arange(int(taken[-1]) + 1) / rate
    return Grid(rate, uniform, tuple(notes), filled, rows, taken)


def _require_rows(table: Table, rows: int) -> None:
    if rows < MINIMUM_ROWS:
        raise DataError(f"{table.path}: it has {rows} rows; at least {MINIMUM_ROWS} are needed")


def _require_increasing(table: Table, name: str, values: NDArray[Any]) -> None:
    wrong = np.flatnonzero(np.diff(values) <= 0)
    if wrong.size:
        k = int(wrong[0]) + 1
        what = "repeats" if values[k] == values[k - 1] else "runs backwards:"
        raise DataError(
            f"{table.path}: {table.row(k)}: column '{name}' {what} "
            f"{values[k]:.9g} after {values[k - 1]:.9g}"
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


def _require_uniform(table: Table, name: str, time_s: Array, ticks: Ticks, rate: float) -> None:
    off = (time_s - time_s[0]) * rate - ticks
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) <= TOLERANCE_PERIODS:
        return
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
