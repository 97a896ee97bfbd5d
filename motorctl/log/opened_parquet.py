"""A Parquet file that is open: what is read of it is what was written, or is told as damaged.

The checksums of a file do not cover the heads of its pages. Where a bit of one has changed, a page
may be passed over as one of an unknown kind, without an error; so the rows are counted as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NoReturn, Self

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.errors import DataError

READ_ANEW = "; copy it anew from where it was recorded, or have it from a backup"
_UNREADABLE = (pa.ArrowException, OSError, ValueError, KeyError)


class OpenedParquet:
    """A Parquet file, open until it is closed, or left as a context.

    Every read raises DataError where the file is damaged; it tells the column and the row group.

    Parameters
    ----------
    called
        What messages call it; its path, where it is opened by this.
    raw
        Where it is open already, as one of an object store is. Then what a network or a disk fails
        in is raised as it is, so that it can be tried again.
    memory_map
        Whether it is read from the computer's own copy in memory.
    metadata
        What stands at its end, where that was read before.
    """

    def __init__(
        self,
        called: Path | str,
        raw: Any = None,
        *,
        memory_map: bool = False,
        metadata: pq.FileMetaData | None = None,
    ) -> None:
        self.called = called
        self._passes_on = raw is not None
        try:
            self._file = pq.ParquetFile(
                called if raw is None else raw,
                memory_map=memory_map,
                metadata=metadata,
                page_checksum_verification=True,
            )
            self.metadata: pq.FileMetaData = self._file.metadata
            self.schema: pa.Schema = self._file.schema_arrow
            groups = range(self.metadata.num_row_groups)
            self.group_rows = tuple(self.metadata.row_group(k).num_rows for k in groups)
            """Rows of each row group."""
        except _UNREADABLE as error:
            self._refuse(error)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, where it was opened by this."""
        self._file.close()

    def column(self, name: str, groups: Sequence[int] | None = None) -> pa.ChunkedArray[Any]:
        """Return a column of some row groups, one after the other; None: of all."""
        found: list[pa.ChunkedArray[Any]] = []
        for k in self._groups(groups):
            try:
                found.append(self._file.read_row_group(k, columns=[name]).column(name))
            except _UNREADABLE as error:
                self._refuse(error, name, k)
            if len(found[-1]) != self.group_rows[k]:
                self._refuse(None, name, k, len(found[-1]))
        if not found:
            return pa.chunked_array([], self.schema.field(name).type)
        return pa.chunked_array([chunk for each in found for chunk in each.chunks], found[0].type)

    def table(
        self, names: Sequence[str] | None = None, groups: Sequence[int] | None = None
    ) -> pa.Table:
        """Return columns of some row groups as a table; None: all."""
        wanted = None if names is None else list(names)
        found = []
        for k in self._groups(groups):
            try:
                found.append(self._file.read_row_group(k, columns=wanted))
            except _UNREADABLE as error:
                self._blame(wanted, k)
                self._refuse(error, None, k)
            if found[-1].num_rows != self.group_rows[k]:
                self._blame(wanted, k)
                self._refuse(None, None, k, found[-1].num_rows)
        empty = self.schema.empty_table()
        return pa.concat_tables(found or [empty if wanted is None else empty.select(wanted)])

    def batches(self, rows: int, names: Sequence[str] | None = None) -> Iterator[pa.RecordBatch]:
        """Yield columns, None: all, in batches of so many rows or less, in constant memory."""
        wanted = None if names is None else list(names)
        for k in self._groups(None):
            read = 0
            try:
                for batch in self._file.iter_batches(rows, row_groups=[k], columns=wanted):
                    read += batch.num_rows
                    yield batch
            except _UNREADABLE as error:
                self._blame(wanted, k)
                self._refuse(error, None, k)
            if read != self.group_rows[k]:
                self._blame(wanted, k)
                self._refuse(None, None, k, read)

    def _groups(self, groups: Sequence[int] | None) -> Sequence[int]:
        return range(len(self.group_rows)) if groups is None else groups

    def _blame(self, names: Sequence[str] | None, group: int) -> None:
        """Raise DataError with the column of a row group that is the damaged one, if one is."""
        for name in self.schema.names if names is None else names:
            self.column(name, [group])

    def _refuse(
        self,
        error: Exception | None,
        name: str | None = None,
        group: int | None = None,
        read: int = 0,
    ) -> NoReturn:
        if error is not None and is_passing(error):
            if self._passes_on:
                raise error
            raise DataError(f"{self.called}: cannot be read: {error}") from error
        where = [] if name is None else [f"column '{name}'"]
        if group is not None:
            where.append(f"row group {group + 1} of {len(self.group_rows)}")
        if error is None and group is not None:
            told = f"has {read} of its {self.group_rows[group]} rows"
            raise damaged(self.called, f"{', '.join(where)}, {told}")
        told = _cause(error)
        raise damaged(self.called, f"{', '.join(where)}: {told}" if where else told) from error


def is_passing(error: Exception) -> bool:
    """Tell whether a disk or a network failed, and not the file; pyarrow calls both OSError."""
    from_outside = isinstance(error, TimeoutError | ConnectionError)
    return from_outside or (isinstance(error, OSError) and error.errno is not None)


def damaged(path: Path | str, cause: Exception | str) -> DataError:
    """Return what is told of a Parquet file that cannot be read."""
    told = cause if isinstance(cause, str) else _cause(cause)
    return DataError(f"{path}: a damaged Parquet file: {told}{READ_ANEW}")


def _cause(error: Exception | None) -> str:
    cause = str(error).splitlines()[0] if str(error) else type(error).__name__
    return "its end is missing" if "magic bytes" in cause else cause
