"""Where a log's columns come from: finished files, one that is being recorded, foreign ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from motorctl.log.convert import ROW_GROUP_ROWS, load_metadata
from motorctl.log.parquet_pieces import ParquetPieces
from motorctl.log.partial import PartialFile
from motorctl.log.recording import Recording
from motorctl.log.table import Table
from motorctl.log.table_parquet import ParquetTable

Array = NDArray[Any]
MOST_HELD = 64
"""Logs of a run that are held open. More use up the files that a process may have open, of which
1024 are usual; fewer cannot be read on while retention removes them. By hand."""


class Columns(Protocol):
    """Named columns of one recording, of `rows` rows."""

    names: tuple[str, ...]
    units: Mapping[str, str]
    descriptions: Mapping[str, str]
    rows: int
    metadata: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def begins(self) -> NDArray[np.int64]:
        """First row of each piece that is read at once, shape (K,)."""

    def read(self, name: str) -> Array:
        """Return an existing column, shape (N,)."""

    def read_rows(self, name: str, first: int, last: int) -> Array:
        """Return the rows from `first` to before `last` of an existing column."""

    def extremes(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what is known beforehand of each piece, (K,): NaN where nothing is."""


class LogColumns:
    """Columns of one log, or of the logs of a run one after the other."""

    def __init__(self, table: Table, parts: Sequence[ParquetTable]) -> None:
        self._parts = parts
        self.names = tuple(table.names)
        self.units, self.descriptions = _told(parts[0].schema)
        self.rows = sum(part.rows for part in parts)
        self.metadata: Mapping[str, Any] = table.metadata
        self.notes = table.notes
        self._starts = np.concatenate(([0], np.cumsum([part.rows for part in parts])))

    def read(self, name: str) -> Array:
        """Return an existing column, shape (N,)."""
        return np.concatenate([part.column(name) for part in self._parts])

    @cached_property
    def _pieces(self) -> list[ParquetPieces]:
        held = len(self._parts) <= MOST_HELD
        return [ParquetPieces(part.path, held=held) for part in self._parts]

    @property
    def begins(self) -> NDArray[np.int64]:
        """First row of each row group, shape (K,)."""
        pieces = zip(self._pieces, self._starts, strict=False)
        return np.concatenate([piece.begins + start for piece, start in pieces])

    def read_rows(self, name: str, first: int, last: int) -> Array:
        """Return the rows from `first` to before `last` of an existing column."""
        read = []
        for piece, start in zip(self._pieces, self._starts, strict=False):
            begin, end = max(first - int(start), 0), min(last - int(start), piece.rows)
            if begin < end:
                read.append(piece.read(name, begin, end))
        return np.concatenate(read) if read else self._pieces[0].read(name, 0, 0)

    def extremes(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the least and greatest value of each row group, as the files keep them."""
        low, high = zip(*(piece.extremes(name) for piece in self._pieces), strict=True)
        return np.concatenate(low), np.concatenate(high)


class UnfinishedColumns:
    """Columns of a log that is still recorded, or was not finished: its whole rows of now."""

    def __init__(self, path: Path) -> None:
        source = PartialFile(path)
        try:
            self._table = pa.Table.from_batches(list(source.batches()), source.schema)
        finally:
            source.close()
        self.names = tuple(source.schema.names)
        self.units, self.descriptions = _told(source.schema)
        self.rows = self._table.num_rows
        self.metadata: Mapping[str, Any] = load_metadata(source.schema)
        damaged = f"; {source.given_up_bytes} bytes are left out" if source.torn else ""
        self.notes: tuple[str, ...] = (f"not finished: the rows that are on the disk now{damaged}",)

    def read(self, name: str) -> Array:
        """Return an existing column, shape (N,)."""
        return np.asarray(self._table.column(name).to_numpy())

    @property
    def begins(self) -> NDArray[np.int64]:
        """First row of each piece, shape (K,)."""
        return np.arange(0, self.rows, ROW_GROUP_ROWS)

    def read_rows(self, name: str, first: int, last: int) -> Array:
        """Return the rows from `first` to before `last` of an existing column."""
        return np.asarray(self._table.column(name).slice(first, last - first).to_numpy())

    def extremes(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return that nothing is known beforehand of a piece."""
        return _nothing_known(self.begins)


class ForeignColumns:
    """Columns of a foreign recording, under the names that a log has for them."""

    def __init__(self, recording: Recording) -> None:
        self._columns: dict[str, Array] = {"time_s": recording.time_s}
        units = {"time_s": "s"}
        for name, axis in recording.axes.items():
            position = axis.position_unit
            for signal, values, unit in (
                ("reference_m", axis.reference, position),
                ("reference_velocity_m_s", axis.reference_velocity, f"{position}/s"),
                ("reference_acceleration_m_s2", axis.reference_acceleration, f"{position}/s^2"),
                ("position_m", axis.position, position),
                ("velocity_m_s", axis.velocity, f"{position}/s"),
                ("following_error_m", axis.following_error, position),
                ("command_v", axis.command, axis.command_unit),
            ):
                if values is not None:
                    self._columns[f"{name}.{signal}"] = values
                    units[f"{name}.{signal}"] = unit
        self.names = tuple(self._columns)
        self.units: Mapping[str, str] = units
        self.descriptions: Mapping[str, str] = {}
        self.rows = len(recording.time_s)
        self.metadata: Mapping[str, Any] = recording.metadata
        self.notes = recording.notes

    def read(self, name: str) -> Array:
        """Return an existing column, shape (N,)."""
        return self._columns[name]

    @property
    def begins(self) -> NDArray[np.int64]:
        """First row of each piece, shape (K,)."""
        return np.arange(0, self.rows, ROW_GROUP_ROWS)

    def read_rows(self, name: str, first: int, last: int) -> Array:
        """Return the rows from `first` to before `last` of an existing column."""
        return self._columns[name][first:last]

    def extremes(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return that nothing is known beforehand of a piece."""
        return _nothing_known(self.begins)


def _nothing_known(
    begins: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    unknown = np.full(len(begins), np.nan)
    return unknown, unknown.copy()


def _told(schema: pa.Schema) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return unit and description by column, as the schema tells them."""
    told = {field.name: field.metadata or {} for field in schema}
    units, words = (
        {name: found.get(key, b"").decode() for name, found in told.items()}
        for key in (b"unit", b"description")
    )
    return units, words
