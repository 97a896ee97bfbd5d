"""Signals in files of their own, as oscilloscopes and Simulink's scopes write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from motorctl.errors import DataError
from motorctl.log.description import Description
from motorctl.log.open_table import open_table
from motorctl.log.table import Array, Table

_SIGNALS = ("position", "velocity", "command", "reference")
_SAME_TIME = 0.25
"""How far apart the times of two rows may be, in periods. As of times on a uniform grid."""


def columns_of_first(description: Description) -> list[str]:
    """Return the columns that stand in the file that the description names first."""
    signals = [getattr(a, s) for a in description.axes.values() for s in _SIGNALS]
    clock = [] if description.time is None else [description.time.column]
    return clock + [s.column for s in signals if s is not None and s.file is None]


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
        Where a file or a column is missing, or the times of the rows are others.
    """
    others: dict[str, Table] = {}
    axes = {}
    for name, axis in description.axes.items():
        moved = {}
        for signal in _SIGNALS:
            column = getattr(axis, signal)
            if column is None or column.file is None:
                continue
            other = others.get(column.file)
            if other is None:
                other = open_table(path.parent / column.file, description.header_line)
                others[column.file] = other
            if column.column not in other.names:
                key = f"axes.{name}.{signal}.column"
                raise DataError(f"{path}: {key}: {other.missing(column.column)}")
            called = f"{column.file}: {column.column}"
            moved[signal] = column.model_copy(update={"column": called, "file": None})
        axes[name] = axis.model_copy(update=moved)
    if not others:
        return table, description
    clock = None if description.time is None else description.time.column
    beside = _Beside(table, others, clock)
    return beside, description.model_copy(update={"axes": axes})


class _Beside(Table):
    """The columns of several files; those of the others are called by their file, too."""

    kind = "several files"

    def __init__(self, first: Table, others: Mapping[str, Table], clock: str | None) -> None:
        names = [f"{file}: {name}" for file, other in others.items() for name in other.names]
        super().__init__(first.path, [*first.names, *names], first.metadata)
        self._first, self._others, self._clock = first, others, clock
        self.notes = (*first.notes, *(n for other in others.values() for n in other.notes))

    def _row_in_file(self, index: int) -> str:
        return self._first.row(index)

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        found = self._first.read([name for name in names if name in self._first.names])
        self.in_seconds = self._first.in_seconds
        for file, other in self._others.items():
            start = f"{file}: "
            wanted = [n.removeprefix(start) for n in names if n.startswith(start)]
            clock = self._clock if self._clock in other.names else None
            read = other.read(wanted if clock is None else [*wanted, clock])
            if clock is not None:
                _require_same_times(other, clock, found[clock], read[clock])
            found |= {start + name: read[name] for name in wanted}
        return found


def _require_same_times(other: Table, clock: str, time: Array, its: Array) -> None:
    rows = min(len(time), len(its))
    usual = float(np.median(np.abs(np.diff(time)))) if len(time) > 1 else 0.0
    apart = np.flatnonzero(np.abs(time[:rows] - its[:rows]) > _SAME_TIME * usual)
    if apart.size:
        k = int(apart[0])
        raise DataError(
            f"{other.path}: {other.row(k)}: column '{clock}' is {its[k]:.9g}, and {time[k]:.9g} in "
            "the first file; rows that stand beside each other must be of the same time: bring "
            "both files onto one clock"
        )
