"""Columns of a Parquet file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.convert import load_metadata
from motorctl.log.memory_needed import require_memory
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.table import Array, Table


class ParquetTable(Table):
    """A Parquet file; our logs are such files."""

    kind = "Parquet"

    def __init__(self, path: Path) -> None:
        with OpenedParquet(path) as file:
            self.schema = file.schema
            self.rows = sum(file.group_rows)
        super().__init__(path, self.schema.names, load_metadata(self.schema))

    def column(self, name: str) -> NDArray[Any]:
        """Return a column in the file's own type, shape (N,). Raises DataError."""
        with OpenedParquet(self.path) as file:
            return np.asarray(file.column(name).to_numpy())

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        require_numbers(self.path, self.schema, names)
        require_memory(self.path, self.rows, len(names))
        with OpenedParquet(self.path, memory_map=True) as file:
            # one at a time: a long log's columns would all be held twice
            return {name: floats_of(file.column(name)) for name in names}


def require_numbers(path: Path | str, schema: pa.Schema, names: Sequence[str]) -> None:
    """Raise DataError where a column holds anything else."""
    for name in names:
        kind = schema.field(name).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise DataError(f"{path}: column '{name}' holds {kind}, not numbers")


def floats_of(column: pa.ChunkedArray[Any]) -> Array:
    """Return a column as float64, shape (N,)."""
    numbers = pc.cast(column, pa.float64(), safe=False).to_numpy()
    return np.require(numbers, np.float64, "W")
