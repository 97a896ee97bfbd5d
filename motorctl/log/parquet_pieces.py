"""A Parquet file row group by row group: of a long log no more is read than what is looked at."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from motorctl.log.table_parquet import damaged


class ParquetPieces:
    """A finished Parquet file, held open; or one that is open, of which `path` is the name.

    Raises DataError where it is damaged, at once or when a piece is read.
    """

    def __init__(self, path: Path | str, file: pq.ParquetFile | None = None) -> None:
        self.path = path
        try:
            self._file = pq.ParquetFile(path) if file is None else file
            groups = range(self._file.metadata.num_row_groups)
            counts = [self._file.metadata.row_group(k).num_rows for k in groups]
        except (pa.ArrowException, OSError, ValueError) as error:
            raise damaged(path, error) from error
        self.begins: NDArray[np.int64] = np.concatenate(
            ([0], np.cumsum(np.array(counts, np.int64)))
        )[:-1]
        """First row of each row group, shape (K,)."""
        self.rows = sum(counts)

    @cached_property
    def _places(self) -> dict[str, int]:
        if not len(self.begins):
            return {}
        group = self._file.metadata.row_group(0)
        return {group.column(k).path_in_schema: k for k in range(group.num_columns)}

    def extremes(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the least and greatest value of each row group, as the file itself keeps them.

        Parameters
        ----------
        name
            A column of numbers.

        Returns
        -------
        low, high
            Shape (K,); NaN where the file keeps none.
        """
        low, high = np.full((2, len(self.begins)), np.nan)
        place = self._places[name]
        for k in range(len(self.begins)):
            told = self._file.metadata.row_group(k).column(place).statistics
            if told is not None and told.has_min_max:
                low[k], high[k] = told.min, told.max
        return low, high

    def read(self, name: str, first: int, last: int) -> NDArray[Any]:
        """Return the rows from `first` to before `last` of a column. Raises DataError."""
        from_group = max(0, int(np.searchsorted(self.begins, first, side="right")) - 1)
        to_group = int(np.searchsorted(self.begins, last, side="left"))
        try:
            table = self._file.read_row_groups([*range(from_group, to_group)], columns=[name])
        except (pa.ArrowException, OSError, ValueError) as error:
            raise damaged(self.path, error) from error
        begin = first - int(self.begins[from_group]) if len(self.begins) else 0
        return np.asarray(table.column(name).slice(begin, last - first).to_numpy())
