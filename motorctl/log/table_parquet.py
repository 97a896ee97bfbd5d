"""Columns of a Parquet file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.convert import load_metadata
from motorctl.log.memory_needed import require_memory
from motorctl.log.table import Array, Table


class ParquetTable(Table):
    """A Parquet file; our logs are such files."""

    kind = "Parquet"

    def __init__(self, path: Path) -> None:
        try:
            with pq.ParquetFile(path) as file:
                self.schema = file.schema_arrow
                self.rows = file.metadata.num_rows
        except (pa.ArrowException, OSError, ValueError) as error:
            raise damaged(path, error) from error
        super().__init__(path, self.schema.names, load_metadata(self.schema))

    def column(self, name: str) -> NDArray[Any]:
        """Return a column in the file's own type, shape (N,). Raises DataError."""
        try:
            with pq.ParquetFile(self.path, page_checksum_verification=True) as file:
                return np.asarray(file.read(columns=[name]).column(name).to_numpy())
        except (pa.ArrowException, OSError, ValueError, KeyError) as error:
            raise damaged(self.path, error) from error

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        require_numbers(self.path, self.schema, names)
        require_memory(self.path, self.rows, len(names))
        try:
            with pq.ParquetFile(
                self.path, memory_map=True, page_checksum_verification=True
            ) as file:
                # one at a time: a long log's columns would all be held twice
                return {name: floats_of(file.read(columns=[name]).column(name)) for name in names}
        except (pa.ArrowException, OSError, ValueError, KeyError) as error:
            raise damaged(self.path, error) from error


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


def damaged(path: Path | str, error: Exception) -> DataError:
    """Return what is told of a Parquet file that cannot be read."""
    cause = str(error).splitlines()[0] if str(error) else type(error).__name__
    if "magic bytes" in cause:
        cause = "its end is missing; copied incompletely?"
    return DataError(f"{path}: a damaged Parquet file: {cause}")
