"""A log, or a run of them, that is too long to be read as a whole."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.measured import SIGNALS
from motorctl.identify.diagnose.freed_memory import give_freed_memory_back
from motorctl.log import Recording
from motorctl.log.columns import axes_of
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.parquet_pieces import ParquetPieces
from motorctl.log.read import recording_of
from motorctl.log.row_groups import RowGroupTable, RunRowGroupTable
from motorctl.log.run_parts import open_recorded
from motorctl.log.run_table import RunTable
from motorctl.log.table_parquet import ParquetTable
from motorctl.log.timebase import MINIMUM_ROWS
from motorctl.long_logs.footer import moved_in, tells_times, times_of
from motorctl.long_logs.scan import ModelsOf, Told, scanned

LONG_ROWS = 1 << 21
"""Rows from which a log is long: no more of it is read than what tells most. Larger takes more
memory, smaller leaves out more of what was recorded. Seven minutes at 5 kHz: diagnosed as a whole,
so many rows of two axes took 1.9 GB, twice as many 3.0."""
_DESCRIPTIONS = (".yaml", ".yml")
_PARQUET = b"PAR1"


@dataclass(frozen=True)
class LongPart:
    """One log of it, known by its footer; K row groups."""

    path: Path
    group_rows: tuple[int, ...]
    begins_s: NDArray[np.float64]
    """First time of each row group, (K,)."""
    ends_s: NDArray[np.float64]
    moved: Mapping[str, tuple[bool, ...]]
    """Of each axis in which row groups its position changed."""

    @property
    def rows(self) -> int:
        """Of the whole log."""
        return sum(self.group_rows)


@dataclass(frozen=True)
class LongLog:
    """A log or a run of logs, of which no row was read so far.

    Attributes
    ----------
    table
        What stands in it.
    parts
        Its logs: one, or those of the run, in order.
    """

    table: ParquetTable | RunTable
    parts: tuple[LongPart, ...]

    @property
    def source(self) -> str:
        """What messages call it."""
        return self.table.called

    @property
    def rows(self) -> int:
        """Of all of it."""
        return sum(part.rows for part in self.parts)

    @cached_property
    def head(self) -> Recording:
        """What it says of itself, with a few of its rows."""
        for k, part in enumerate(self.parts):
            for group, rows in enumerate(part.group_rows):
                if rows >= MINIMUM_ROWS:
                    return self.read({k: [group]})
        raise DataError(f"{self.source}: none of its row groups has {MINIMUM_ROWS} rows")

    def scanned(self, axes: Sequence[str], models_of: ModelsOf) -> Iterator[tuple[int, int, Told]]:
        """Yield part, row group, and what its motion tells of some axes."""
        for k, part in enumerate(self.parts):
            moved = {axis: part.moved[axis] for axis in axes}
            groups = range(len(part.group_rows))
            with OpenedParquet(part.path) as file:
                told = scanned(str(part.path), file, moved, groups, models_of)
                for group, found in zip(groups, told, strict=True):
                    yield k, group, found
            give_freed_memory_back()

    def read(self, groups: Mapping[int, Sequence[int]]) -> Recording:
        """Read some row groups, by part. Raises DataError."""
        with ExitStack() as opened:
            tables = [
                RowGroupTable(
                    str(self.parts[k].path),
                    opened.enter_context(OpenedParquet(self.parts[k].path)),
                    sorted(chosen),
                )
                for k, chosen in sorted(groups.items())
            ]
            if isinstance(self.table, RunTable):
                table = RunRowGroupTable(self.table, tables, self._left_out(groups))
                return recording_of(table, "keep", SIGNALS)
            return recording_of(tables[0], "keep", SIGNALS)

    def _left_out(self, groups: Mapping[int, Sequence[int]]) -> int:
        """Return how many rows lie between the first and the last that is read, and are not."""
        before = list(accumulate((part.rows for part in self.parts), initial=0))
        first, last = min(groups), max(groups)
        begin = before[first] + sum(self.parts[first].group_rows[: min(groups[first])])
        end = before[last] + sum(self.parts[last].group_rows[: max(groups[last]) + 1])
        read = sum(self.parts[k].group_rows[g] for k, own in groups.items() for g in own)
        return end - begin - read


def long_log(paths: Sequence[str | os.PathLike[str]], whole_run: bool = False) -> LongLog | None:
    """Return a recording as a long log; None where it is none, and is read as a whole.

    A long log is a Parquet file that motorctl wrote, or a run of such, of `LONG_ROWS` rows or more
    in row groups whose times its footer knows. Raises DataError as `open_recorded`, and where the
    footers do not fit together.
    """
    if any(Path(path).suffix.lower() in _DESCRIPTIONS or _is_other(Path(path)) for path in paths):
        return None
    table = open_recorded(paths, whole_run)
    if not isinstance(table, ParquetTable | RunTable) or table.rows < LONG_ROWS:
        return None
    if not isinstance(table.metadata.get("config"), Mapping) or "time_s" not in table.names:
        return None
    logs = table.parts if isinstance(table, RunTable) else [table]
    if not _in_pieces([log.path for log in logs]):
        return None
    return LongLog(table, tuple(_part(log.path) for log in logs))


def _in_pieces(paths: Sequence[Path]) -> bool:
    """Tell whether a log has more than one row group, and the footers know the times of all."""
    counts, told = [], True
    for path in paths:
        with OpenedParquet(path) as file:
            counts.append(len(file.group_rows))
            told = told and counts[-1] > 0 and tells_times(ParquetPieces(path, file))
    return max(counts) > 1 and told


def _is_other(path: Path) -> bool:
    """Tell whether a file is there that is none of Parquet: nothing of it is read for that."""
    if not path.is_file():
        return False
    with suppress(OSError), path.open("rb") as file:
        return file.read(len(_PARQUET)) != _PARQUET
    return True  # whoever reads it says why it cannot be


def _part(path: Path) -> LongPart:
    with OpenedParquet(path) as file:
        pieces = ParquetPieces(path, file)
        begins_s, ends_s = times_of(str(path), pieces)
        moved = {axis: moved_in(pieces, axis) for axis in axes_of(file.schema.names)}
        return LongPart(path, file.group_rows, begins_s, ends_s, moved)
