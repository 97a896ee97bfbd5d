"""Signals in files of their own, as oscilloscopes and Simulink's scopes write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from motorctl.errors import DataError
from motorctl.log.description import Description
from motorctl.log.open_table import open_table
from motorctl.log.table import Array, Table
from motorctl.log.text_times import seconds_since_first

_SAME_TIME = 0.25
"""How far apart the times of two rows may be, in periods. As of times on a uniform grid."""


def columns_of_file(description: Description, file: str | None) -> list[str]:
    """Return the clock, and the signals that stand in a file; None: the one named first."""
    signals = [told for axis in description.axes.values() for told in axis.signals.values()]
    clock = [] if description.time is None else [description.time.column]
    return clock + [told.column for told in signals if told.file == file]


def tables_beside(path: Path, description: Description, table: Table) -> tuple[Table, Description]:
    """Put the columns of other files beside those of the first, row by row.

    Parameters
    ----------
    path
        The description.
    description
        Of whose signals some may name a file.
    table
        The file that the description names first.

    Returns
    -------
    Table
        The first alone, where no signal names another.
    Description
        With the names that the columns have in the table.

    Raises
    ------
    DataError
        Where a file or a column is missing.
    """
    others: dict[str, Table] = {}
    axes = {}
    for name, axis in description.axes.items():
        moved = {}
        for signal, column in axis.signals.items():
            if column.file is None:
                continue
            other = others.get(column.file)
            if other is None:
                other = _opened(path.parent / column.file, description, column.file)
                others[column.file] = other
            if column.column not in other.names:
                key = f"axes.{name}.{signal}.column"
                raise DataError(f"{path}: {key}: {other.missing(column.column)}")
            called = f"{_start(column.file)}{column.column}"
            moved[signal] = column.model_copy(update={"column": called, "file": None})
        axes[name] = axis.model_copy(update=moved)
    if not others:
        return table, description
    clock = None if description.time is None else description.time.column
    beside = _Beside(table, others, clock)
    return beside, description.model_copy(update={"axes": axes})


def _opened(path: Path, description: Description, file: str) -> Table:
    """Open another file; its header is known by its columns and the clock, if it has that."""
    wanted = columns_of_file(description, file)
    try:
        return open_table(path, wanted=wanted)
    except DataError:
        signals = wanted if description.time is None else wanted[1:]
        return open_table(path, wanted=signals)


def _start(file: str) -> str:
    """Return what the names of a file's columns begin with in the table of all."""
    return f"{file}: "


class _Beside(Table):
    """The columns of several files; those of the others are called by their file, too.

    Rows stand beside each other by the clock, where the other file has it as well, else by their
    number: then every line of both must be a row.
    """

    kind = "several files"

    def __init__(self, first: Table, others: Mapping[str, Table], clock: str | None) -> None:
        named = {_start(file): other for file, other in others.items()}
        names = [start + name for start, other in named.items() for name in other.names]
        super().__init__(first.path, [*first.names, *names], first.metadata)
        self._first, self._others, self._clock = first, named, clock

    def holding(self, column: str) -> Table:
        """Return the table of the file in which a column stands."""
        starts = (other for start, other in self._others.items() if column.startswith(start))
        return next(starts, self._first)

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        found: dict[str, Array] = {}
        notes: list[str] = []
        lead, rows = None, 0  # the file that is read first: the others are put beside it
        for start, table in {"": self._first, **self._others}.items():
            wanted = [n.removeprefix(start) for n in names if self.holding(n) is table]
            if not wanted:
                continue
            # where columns are counted, what the clock is called may be a signal of the other file
            timed = table is not self._first and self._clock in set(table.names) - set(wanted)
            clock = self._clock if timed else None
            read = table.read(wanted if clock is None else [*wanted, clock])
            if lead is None:
                lead, rows = table, len(read[wanted[0]])
            elif clock is not None:
                _require_same_times(lead, table, clock, found[clock], read[clock])
            else:
                _require_all_rows(lead, table, rows, len(read[wanted[0]]))
                notes.append(
                    f"the rows of {table.path.name} stand beside those of {lead.path.name} by "
                    "their number alone: no clock was compared"
                )
            found |= {start + name: read[name] for name in wanted}
            self.in_seconds |= {start + n: begin for n, begin in table.in_seconds.items()}
            notes += [start + note for note in table.notes]
        self.notes = tuple(dict.fromkeys((*self.notes, *notes)))
        return found


def _require_all_rows(lead: Table, other: Table, rows: int, its_rows: int) -> None:
    """Raise DataError where rows of files without a common clock may not be of the same time."""
    way_out = "no clock that both have tells which rows stand beside each other: "
    for table in (lead, other):
        if table.passed_over:
            lines = "a line is" if table.passed_over == 1 else f"{table.passed_over} lines are"
            raise DataError(f"{table.path}: {lines} no row of numbers, and {way_out}mend the file")
    if rows != its_rows:
        raise DataError(
            f"{other.path}: has {its_rows} rows, and {lead.path} {rows}; {way_out}both must have "
            "as many"
        )


def _require_same_times(lead: Table, other: Table, clock: str, time: Array, its: Array) -> None:
    """Raise DataError where the times of two files are others in the rows that both have."""
    later, since = _began_later(lead, other, clock)
    rows = min(len(time), len(its))
    steps = np.abs(np.diff(time))
    known = steps[~np.isnan(steps)]
    limit = _SAME_TIME * float(np.median(known)) if known.size else 0.0
    mine, its = time[:rows], its[:rows] + later
    same = (np.abs(mine - its) <= limit) | (np.isnan(mine) & np.isnan(its))
    if not same.all():
        k = int(np.argmin(same))
        raise DataError(
            f"{other.path}: {other.row(k)}: column '{clock}' is {_shown(its[k])}, and "
            f"{_shown(mine[k])} in the first file{since}; rows that stand beside each other must "
            "be of the same time: bring both files onto one clock"
        )


def _began_later(lead: Table, other: Table, clock: str) -> tuple[float, str]:
    """Return how much later a clock of dates began in the other file [s], and a word of it.

    Raises DataError where the clocks are not of one kind.
    """
    begins = [table.in_seconds[clock] for table in (lead, other) if clock in table.in_seconds]
    if not begins:
        return 0.0, ""
    seconds, wrong = seconds_since_first(begins)
    if len(begins) == 1 or wrong is not None:
        shown = (f"{t.path} {t.in_seconds.get(clock, 'numbers')}" for t in (other, lead))
        raise DataError(
            f"{other.path}: column '{clock}' is a clock of another kind: {' and '.join(shown)}; "
            "bring both files onto one clock"
        )
    return float(seconds[1]), f" (seconds from {begins[0]})"


def _shown(value: float) -> str:
    return "blank" if np.isnan(value) else f"{value:.9g}"
