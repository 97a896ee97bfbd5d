"""The logs of one run as one table: their rows one after the other, and what is missing between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from motorctl.errors import DataError
from motorctl.log.memory_needed import require_memory
from motorctl.log.open_table import open_table
from motorctl.log.table import Array, Table
from motorctl.log.table_parquet import ParquetTable


class RunTable(Table):
    """Several logs of a run, in the order of their parts.

    Parameters
    ----------
    paths
        The logs, in any order.
    notes
        What else is to be told of how they were found.

    Raises
    ------
    DataError
        Where one is no log of a run, where they are of different runs or configurations, or where
        two are the same part.
    """

    kind = "run of logs"

    def __init__(self, paths: Sequence[Path], notes: Sequence[str] = ()) -> None:
        self.parts = sorted((_log(path) for path in dict.fromkeys(paths)), key=_part)
        first, last = self.parts[0], self.parts[-1]
        for before, part in zip(self.parts, self.parts[1:], strict=False):
            _must_follow(before, part)
        self._ends = np.cumsum([part.rows for part in self.parts])
        super().__init__(
            first.path.parent / str(first.metadata["run"]), first.names, _joined(self.parts)
        )
        whole = f"parts {_part(first)} to {_part(last)}"
        self.notes = (
            f"{len(self.parts)} logs ({whole} of the run) as one recording",
            *notes,
            *self._missing(),
        )

    @property
    def rows(self) -> int:
        """Of all parts."""
        return int(self._ends[-1])

    def _row_in_file(self, index: int) -> str:
        """Return in which log which row has this index (from 0)."""
        k = int(np.searchsorted(self._ends, index, side="right"))
        part = self.parts[k]
        return f"{part.path.name}, {part.row(index - int(self._ends[k]) + part.rows)}"

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        require_memory(self.path, self.rows, len(names))
        columns = {name: np.empty(self.rows) for name in names}
        for part, end in zip(self.parts, self._ends, strict=True):
            for name in names:  # one at a time: no part is held as a whole beside the columns
                columns[name][end - part.rows : end] = part.read([name])[name]
        return columns

    def _missing(self) -> Iterator[str]:
        """Say which parts are not there, and how large the holes are that they leave."""
        for before, part in zip(self.parts, self.parts[1:], strict=False):
            lost = range(_part(before) + 1, _part(part))
            if not lost:
                continue
            which = f"part {lost[0]} is" if len(lost) == 1 else f"parts {lost[0]} to {lost[-1]} are"
            last_s = float(before.read(["time_s"])["time_s"][-1])
            first_s = float(part.read(["time_s"])["time_s"][0])
            yield (
                f"{which} missing between {before.path.name} and {part.path.name}: from "
                f"{last_s:.6g} to {first_s:.6g} s nothing is known"
            )


def _log(path: Path) -> ParquetTable:
    table = open_table(path)
    told = table.metadata
    if not isinstance(table, ParquetTable) or not (
        isinstance(told.get("run"), str) and isinstance(told.get("part"), int)
    ):
        raise DataError(
            f"{path}: does not say which part of which run it is; only logs of one run of a daemon "
            "are read as one recording"
        )
    return table


def _part(table: ParquetTable) -> int:
    return int(table.metadata["part"])


def _must_follow(before: ParquetTable, part: ParquetTable) -> None:
    """Raise DataError where a log cannot be a later part of the same run."""
    told, other = before.metadata, part.metadata
    if told["run"] != other["run"]:
        raise DataError(
            f"{part.path} is of the run {other['run']}, {before.path} of {told['run']}: give the "
            "logs of one run; `motorctl compare` sets runs beside each other"
        )
    if _part(before) == _part(part):
        raise DataError(f"{before.path} and {part.path} are both part {_part(part)} of the run")
    if told.get("config") != other.get("config") or before.names != part.names:
        raise DataError(
            f"{before.path} and {part.path} were recorded with different configurations, though "
            f"both name the run {told['run']}"
        )


def _joined(parts: Sequence[ParquetTable]) -> dict[str, Any]:
    """Return the metadata of all parts: a log ends with what is known of the run until then."""
    first, last = parts[0].metadata, parts[-1].metadata
    joined = {**first, **last, "predecessor": first.get("predecessor")}
    joined["part"] = [_part(part) for part in parts]
    # A summary of one log's times, and hours of rows have none.
    joined.pop("timing", None)
    joined["rows"] = sum(part.rows for part in parts)
    if any("rows_lost" in part.metadata for part in parts):
        joined["rows_lost"] = sum(int(part.metadata.get("rows_lost") or 0) for part in parts)
    pauses = [p for part in parts if isinstance(p := part.metadata.get("pauses"), dict)]
    if pauses:
        totals = {key: sum(p.get(key, 0) for p in pauses) for key in ("count", "seconds")}
        joined["pauses"] = {**pauses[-1], **totals}
    return joined
