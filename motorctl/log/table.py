"""A file of columns, before anything is known of what they mean."""

from __future__ import annotations

import difflib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError

Array = NDArray[np.float64]

_SHOWN_NAMES = 12
MOST_MATRIX_COLUMNS = 256
"""A matrix of more columns is no table of signals."""
MOST_BLANK = 0.01
"""Part of a column that may be blank and is filled in; more is a column that is not what it should
be."""
MOST_REPEATED = 0.01
"""Part of the rows that may repeat the time of the one before and are left out. Larger takes a
clock of too few digits for rows written twice, smaller refuses recordings of loggers that write a
sample anew. Chosen by hand: such a clock repeats every second time; of 50,500 to 191,000 rows that
others recorded one stood twice, of 3,700 of a leg's drive 20 to 34."""


class Table(ABC):
    """Named columns of one file. `names` and `metadata` are known once it is open."""

    kind: str
    notes: tuple[str, ...] = ()
    """What a reader of results should know of the file."""
    left_out: int = 0
    """Rows between those of the table that were left out on purpose."""
    passed_over: int = 0
    """Lines among the rows, or behind them, that were none and were left out."""

    def __init__(
        self, path: Path, names: Sequence[str], metadata: Mapping[str, Any] | None = None
    ) -> None:
        self.path = path
        self.called = str(path)
        """What messages call it."""
        self.names, self.repeated = _told_apart(names)
        self.metadata = dict(metadata or {})
        self.in_seconds: dict[str, str] = {}
        """Columns of dates or times of day that were read as seconds, and the first of each."""
        self._kept: NDArray[np.intp] | None = None

    @abstractmethod
    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        """Read existing columns; an empty cell is NaN. Raises DataError."""

    def row(self, index: int, column: str = "") -> str:
        """Return where the row with this index (from 0) stands, counting from 1 as people do.

        In the file of a column, where columns are of several.
        """
        place = index if self._kept is None else int(self._kept[index])
        return self.holding(column)._row_in_file(place)

    def holding(self, column: str) -> Table:
        """Return the table of the file in which a column stands."""
        return self

    def _row_in_file(self, index: int) -> str:
        return f"row {index + 1}"

    def without_empty_rows(self, columns: dict[str, Array], clock: str) -> dict[str, Array]:
        """Leave out the rows in which nothing was recorded.

        These are blank in every column, or stand at the end of the file where the clock is 0 for
        good: what a buffer had left, or a recorder that waits. `notes` tell, and from then on `row`
        tells where the others stand in the file.
        """
        blank = np.logical_and.reduce([np.isnan(values) for values in columns.values()])
        stopped = blank | (columns[clock] == 0.0)
        unfilled = np.zeros_like(blank)
        if stopped[-1:].any() and np.nanmax(columns[clock], initial=0.0) > 0.0:
            unfilled[int(np.flatnonzero(~stopped)[-1]) + 1 :] = True
        empty = blank | unfilled
        if not empty.any() or empty.all():
            return columns
        count = int(np.count_nonzero(empty))
        note = f"{count} row{'s' if count > 1 else ''} without a value left out"
        told = f"{note}, the first: {self.row(int(np.argmax(empty)))}"
        self.notes = (*self.notes, told)
        return self._keeping(columns, ~empty)

    def from_where_the_clock_runs(self, columns: dict[str, Array], clock: str) -> dict[str, Array]:
        """Leave out the rows written before the clock ran: all but the last with its first time.

        Only where every time behind them comes after the one before: else the clock has too few
        digits, or rows stand twice, and which of them is right is not known. `notes` tell.
        """
        time = columns[clock]
        waiting = int(np.count_nonzero(time == time[:1])) - 1
        if waiting < 1 or not (np.diff(time[waiting:]) > 0.0).all() or waiting == len(time) - 1:
            return columns
        rows = f"{waiting} rows" if waiting > 1 else "a row"
        told = f"{rows} written before the clock ran left out, the first: {self.row(0)}"
        self.notes = (*self.notes, told)
        return self._keeping(columns, np.arange(len(time)) >= waiting)

    def without_repeated_times(self, columns: dict[str, Array], clock: str) -> dict[str, Array]:
        """Leave out rows with the time of the one before: where they stand twice, or are few.

        Only where no time runs backwards and each of them is the row before once more, or they are
        no more than `MOST_REPEATED` of the rows: else the clock has too few digits. `notes` tell.
        """
        time = columns[clock]
        repeats = np.concatenate([[False], time[1:] == time[:-1]])
        count = int(np.count_nonzero(repeats))
        if not count or (time[1:] < time[:-1]).any():
            return columns
        again = np.flatnonzero(repeats)
        twice = all(
            np.array_equal(values[again], values[again - 1], equal_nan=True)
            for values in columns.values()
        )
        if not twice and count > MOST_REPEATED * len(time):
            return columns
        rows = "a row that repeats" if count == 1 else f"{count} rows that repeat"
        of = "the one before" if twice else "the time of the one before"
        self.notes = (*self.notes, f"{rows} {of} left out, the first: {self.row(int(again[0]))}")
        return self._keeping(columns, ~repeats)

    def _keeping(self, columns: dict[str, Array], rows: NDArray[np.bool_]) -> dict[str, Array]:
        """Return these rows of columns; `row` tells where they stand from now on."""
        kept = np.arange(len(rows)) if self._kept is None else self._kept
        self._kept = kept[rows]
        return {name: values[rows] for name, values in columns.items()}

    def read(self, names: Iterable[str]) -> dict[str, Array]:
        """Read columns as float64, all equally long.

        A recorder that is stopped between two columns leaves some one row longer: that row is left
        out, and `notes` tell. Raises DataError where a column is missing, is not made of numbers or
        differs more in length.
        """
        wanted = list(dict.fromkeys(names))
        for name in wanted:
            self.require(name)
        columns = self._load(wanted)
        lengths = {name: len(values) for name, values in columns.items()}
        first, rows = wanted[0], min(lengths.values())
        if max(lengths.values()) - rows > 1:
            name = next(name for name in wanted if lengths[name] != lengths[first])
            raise DataError(
                f"{self.called}: column '{name}' has {lengths[name]} rows, "
                f"but '{first}' has {lengths[first]}"
            )
        longer = [name for name in wanted if lengths[name] > rows]
        if longer:
            shorter = next(name for name in wanted if lengths[name] == rows)
            note = (
                f"column '{shorter}' has {rows} rows, and '{longer[0]}' {rows + 1}: the last row "
                "of the longer ones was left out"
            )
            self.notes = tuple(dict.fromkeys((*self.notes, note)))
            columns |= {name: columns[name][:rows] for name in longer}
        return columns

    def require(self, name: str) -> None:
        """Raise DataError, telling which columns there are, where there is no such column."""
        if name not in self.names:
            raise DataError(self.missing(name))

    def missing(self, name: str) -> str:
        """Return a sentence: there is no such column, or more than one, and which there are."""
        if name in self.repeated:
            return (
                f"{self.called}: there is more than one column '{name}'; say '{name} (1)', or (2)"
            )
        close = difflib.get_close_matches(name, self.names, n=1, cutoff=0.75)
        hint = f"; did you mean '{close[0]}'?" if close else "."
        return f"{self.called}: no column '{name}'{hint} There are: {self.listing()}"

    def listing(self) -> str:
        """List the columns, shortened where they are many."""
        named = [name for name in self.names if name]
        shown = ", ".join(named[:_SHOWN_NAMES])
        more = len(named) - _SHOWN_NAMES
        return (shown or "none") + (f" and {more} more" if more > 0 else "")

    def without_blanks(self, name: str, values: Array) -> tuple[Array, NDArray[np.bool_] | None]:
        """Fill in the few values of a column that are blank, linearly.

        Returns
        -------
        values : ndarray
            Finite, (N,).
        blank : ndarray or None
            Which were filled in, (N,); None: none.

        Raises
        ------
        DataError
            With the row, where a value is infinite or more are blank than `MOST_BLANK`.
        """
        blank = np.isnan(values)
        if not blank.any():
            self.require_finite(name, values)
            return values, None
        if np.mean(blank) > MOST_BLANK or np.isinf(values).any():
            self.require_finite(name, values)
        rows = np.arange(len(values))
        return np.interp(rows, rows[~blank], values[~blank]), blank

    def require_finite(self, name: str, values: Array) -> None:
        """Raise DataError, telling the row, where a value is not finite."""
        wrong = np.flatnonzero(~np.isfinite(values))
        if wrong.size:
            k = int(wrong[0])
            value = "empty or not a number" if np.isnan(values[k]) else "infinite"
            raise DataError(
                f"{self.holding(name).called}: {self.row(k, name)}: column '{name}' is {value} "
                f"({wrong.size} such of {len(values)} rows)"
            )


def _told_apart(names: Sequence[str]) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return names of which none stands twice, and those that did: they are numbered, from 1."""
    repeated = frozenset(name for name, count in Counter(names).items() if count > 1)
    numbers: Counter[str] = Counter()
    apart: list[str] = []
    for name in names:
        numbers[name] += 1
        apart.append(f"{name} ({numbers[name]})" if name in repeated else name)
    return tuple(apart), repeated
