"""Columns of NumPy's files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from motorctl.errors import DataError
from motorctl.log.table import MOST_MATRIX_COLUMNS, Array, Table


class NumpyTable(Table):
    """An NPZ or NPY file: vectors by name, columns of a matrix as ``name[:,k]``, k from 0.

    The array of an NPY file has no name: its columns are ``[:,k]``.
    """

    kind = "NumPy"

    def __init__(self, path: Path) -> None:
        try:
            content = np.load(path, allow_pickle=False)
            arrays = {"": content} if isinstance(content, np.ndarray) else dict(content)
        except Exception as error:  # a damaged archive makes the reader fail in any way
            cause = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise DataError(f"{path}: not a NumPy file of numbers: {cause}") from error
        self._columns = {
            column: values for name, value in arrays.items() for column, values in _of(name, value)
        }
        super().__init__(path, tuple(self._columns))

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        return {name: self._columns[name].astype(np.float64) for name in names}


def _of(name: str, value: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    if value.dtype.names:
        for field in value.dtype.names:
            yield from _of(f"{name}.{field}" if name else field, value[field])
    elif value.dtype.kind not in "fiub" or value.size < 2:
        return
    elif max(value.shape) == value.size:
        yield name or "[:]", value.ravel()
    elif value.ndim == 2 and value.shape[1] <= MOST_MATRIX_COLUMNS:
        yield from ((f"{name}[:,{k}]", value[:, k]) for k in range(value.shape[1]))
