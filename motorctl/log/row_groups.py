"""Some row groups of one log or of a run's as a table: no more is read than is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motorctl.log.convert import load_metadata
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.run_table import RunTable
from motorctl.log.table import Array, Table
from motorctl.log.table_parquet import floats_of, require_numbers


class RowGroupTable(Table):
    """Row groups of an open file, one after the other; between them time may jump.

    Parameters
    ----------
    source
        What messages call the file.
    file
        The open file, local or not.
    groups
        Their indices, ascending.
    """

    kind = "Parquet"

    def __init__(self, source: str, file: OpenedParquet, groups: Sequence[int]) -> None:
        self._file, self._groups = file, list(groups)
        counts = file.group_rows
        self._begins = np.concatenate(([0], np.cumsum(np.array(counts, np.int64))))
        self._ends = np.cumsum([counts[k] for k in self._groups])
        super().__init__(Path(source), file.schema.names, load_metadata(file.schema))
        self.called = source  # a path makes one slash of the two of an address
        span = range(self._groups[0], self._groups[-1] + 1) if self._groups else range(0)
        self.left_out = sum(counts[k] for k in span) - self.rows

    @property
    def rows(self) -> int:
        """Of the row groups that are read."""
        return int(self._ends[-1]) if len(self._ends) else 0

    def _row_in_file(self, index: int) -> str:
        """Return where the row with this index stands in the whole file, counting from 1."""
        k = int(np.searchsorted(self._ends, index, side="right"))
        before = int(self._ends[k - 1]) if k else 0
        return super()._row_in_file(int(self._begins[self._groups[k]]) + index - before)

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        require_numbers(self.called, self._file.schema, names)
        read = self._file.table(names, self._groups)
        return {name: floats_of(read.column(name)) for name in names}


class RunRowGroupTable(Table):
    """Row groups of several logs of a run, one after the other.

    Parameters
    ----------
    run
        The whole run.
    parts
        What is read of its logs, in their order.
    left_out
        Rows of the run between those.
    """

    kind = "run of logs"

    def __init__(self, run: RunTable, parts: Sequence[RowGroupTable], left_out: int) -> None:
        self.parts = list(parts)
        self._ends = np.cumsum([part.rows for part in self.parts])
        super().__init__(run.path, run.names, run.metadata)
        self.left_out = left_out

    def _row_in_file(self, index: int) -> str:
        k = int(np.searchsorted(self._ends, index, side="right"))
        part = self.parts[k]
        return f"{part.path.name}, {part.row(index - int(self._ends[k]) + part.rows)}"

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        read = [part.read(names) for part in self.parts]
        return {name: np.concatenate([each[name] for each in read]) for name in names}
