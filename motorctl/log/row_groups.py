"""Some row groups of a Parquet file as a table: of a long log no more is read than is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motorctl.log.convert import load_metadata
from motorctl.log.opened_parquet import OpenedParquet
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

    def _row_in_file(self, index: int) -> str:
        """Return where the row with this index stands in the whole file, counting from 1."""
        k = int(np.searchsorted(self._ends, index, side="right"))
        before = int(self._ends[k - 1]) if k else 0
        return super()._row_in_file(int(self._begins[self._groups[k]]) + index - before)

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        require_numbers(self.called, self._file.schema, names)
        read = self._file.table(names, self._groups)
        return {name: floats_of(read.column(name)) for name in names}
