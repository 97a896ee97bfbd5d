"""A Parquet file row group by row group: of a long log no more is read than what is looked at."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.opened_parquet import OpenedParquet


class ParquetPieces:
    """A finished Parquet file, or one that is open already, of which `path` is but the name.

    Raises DataError where it is damaged, at once or when a piece is read.

    Parameters
    ----------
    path
        The file.
    file
        Where it is open already: wherever it lies, it stays so.
    held
        Whether it is held open, so that it can be read though it is removed meanwhile. A run of
        many logs would use up what a process may have open.
    """

    def __init__(
        self, path: Path | str, file: OpenedParquet | None = None, *, held: bool = True
    ) -> None:
        self.path = path
        self._file: OpenedParquet | None = None
        if file is None:
            self._mark = _mark(path)
            file = OpenedParquet(path)
        else:
            held = True
        self._metadata = file.metadata
        if held:
            self._file = file
        else:
            file.close()
        self.begins: NDArray[np.int64] = np.concatenate(
            ([0], np.cumsum(np.array(file.group_rows, np.int64)))
        )[:-1]
        """First row of each row group, shape (K,)."""
        self.rows = sum(file.group_rows)

    @cached_property
    def _places(self) -> dict[str, int]:
        if not len(self.begins):
            return {}
        group = self._metadata.row_group(0)
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
            told = self._metadata.row_group(k).column(place).statistics
            if told is not None and told.has_min_max:
                low[k], high[k] = told.min, told.max
        return low, high

    def read(self, name: str, first: int, last: int) -> NDArray[Any]:
        """Return the rows from `first` to before `last` of a column. Raises DataError."""
        from_group = max(0, int(np.searchsorted(self.begins, first, side="right")) - 1)
        to_group = int(np.searchsorted(self.begins, last, side="left"))
        groups = range(from_group, to_group)
        if self._file is not None:
            column = self._file.column(name, groups)
        else:
            column = self._read_anew(groups, name)
        begin = first - int(self.begins[from_group]) if len(self.begins) else 0
        return np.asarray(column.slice(begin, last - first).to_numpy())

    def _read_anew(self, groups: range, name: str) -> pa.ChunkedArray[Any]:
        if _mark(self.path) != self._mark:
            raise DataError(f"{self.path}: is another file than when it was opened: open it anew")
        with OpenedParquet(self.path, metadata=self._metadata) as file:
            return file.column(name, groups)


def _mark(path: Path | str) -> tuple[int, int, int]:
    """Return what tells a file from one that was put in its place. Raises DataError."""
    try:
        found = Path(path).stat()
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    return found.st_ino, found.st_size, found.st_mtime_ns
