"""A recording whose columns are read when somebody asks for them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.api.signals import Array, Signals
from motorctl.notebook import html_lines, html_table

if TYPE_CHECKING:
    from motorctl.api.log_columns import Columns
    from motorctl.log.info import LogInfo

RecordingPath = str | os.PathLike[str]


@dataclass(frozen=True)
class Extremes:
    """What a column lies between in each piece of a log, shape (K,) each."""

    begins: NDArray[np.int64]
    """The piece's first row."""
    low: NDArray[np.float64]
    high: NDArray[np.float64]


class Log(Signals):
    """A log or a foreign recording; `open_log` makes it.

    ``log["x.position_m"]`` is an array of shape (N,), read from the file the first time. A foreign
    recording has its columns under the same names, and `units` say what they are in: a rotary axis
    has ``position_m`` in rad.
    """

    def __init__(self, paths: Sequence[Path], whole_run: bool, columns: Columns) -> None:
        self.paths = tuple(paths)
        self.whole_run = whole_run
        """Whether the one log stands for all of its run."""
        self.rows = columns.rows
        """N."""
        self.units, self.descriptions = columns.units, columns.descriptions
        self.metadata: Mapping[str, Any] = columns.metadata
        """What the log says of its run: machine, configuration, seed, timing; empty else."""
        self.notes: tuple[str, ...] = columns.notes
        """What a reader of results should know of how the file was read."""
        self._columns = columns
        self._read: dict[str, Array] = {}

    @property
    def source(self) -> str:
        """The file, or the files."""
        return ", ".join(map(str, self.paths))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self._columns.names

    @property
    def sample_rate_hz(self) -> float:
        """Rows a second: as the log says it, else by its times."""
        rate = self.metadata.get("rate_hz")
        return float(rate) if isinstance(rate, int | float) else 1.0 / _period_s(self.time_s)

    @property
    def duration_s(self) -> float:
        """From the first row to the end of the last one, in whole samples [s]."""
        if not self.rows:
            return 0.0
        rate = self.sample_rate_hz
        return (round(float(self.time_s[-1] - self.time_s[0]) * rate) + 1) / rate

    def info(self) -> LogInfo:
        """Return what ``motorctl log info`` tells: faults, missed samples, timing.

        Raises DataError where the recording cannot be read any more.
        """
        from motorctl.log.info import describe, describe_run
        from motorctl.log.run_parts import is_run

        if is_run(self.paths, self.whole_run):
            return describe_run(self.paths, self.whole_run)
        return describe(self.paths[0])

    def part(self, name: str, first: int, last: int) -> Array:
        """Return some rows of a column, read now and not kept: for logs that memory cannot hold.

        Parameters
        ----------
        name
            The column.
        first, last
            From this row to before that one; of a finished log only the row groups in which they
            stand are read.

        Returns
        -------
        Array
            Shape (last - first,), less where the log has fewer.

        Raises
        ------
        DataError
            Where the recording cannot be read any more.
        """
        self._must_have(name)
        first, last = max(first, 0), min(last, self.rows)
        return self._columns.read_rows(name, first, max(first, last))

    def extremes(self, name: str) -> Extremes:
        """Return the least and greatest value of each row group of a column, without reading rows.

        Finished logs keep them of each row group; NaN stands where a file keeps none.
        """
        self._must_have(name)
        return Extremes(self._columns.begins, *self._columns.extremes(name))

    def _column(self, name: str) -> Array:
        if name not in self._read:
            values = self._columns.read(name)
            values.flags.writeable = False
            self._read[name] = values
        return self._read[name]

    def __repr__(self) -> str:
        axes = ", ".join(self.axes)
        return f"<Log {self.source}: {self.rows} rows, {self.duration_s:.6g} s, axes {axes}>"

    def _repr_html_(self) -> str:
        from motorctl.api.log_picture import log_picture

        rows = [
            ("rows", f"{self.rows} at {self.sample_rate_hz:g} Hz: {self.duration_s:.6g} s"),
            ("axes", ", ".join(self.axes)),
            *((key, self.metadata[key]) for key in _TOLD if self.metadata.get(key)),
        ]
        table = html_table(("", ""), rows, self.source)
        return table + html_lines(f"note: {note}" for note in self.notes) + log_picture(self)


_TOLD = ("machine", "version", "started_utc")


def open_log(recording: RecordingPath | Sequence[RecordingPath], *, whole_run: bool = False) -> Log:
    """Open a log, an unfinished one, a run of logs or a foreign recording.

    Nothing but names is read of a finished log until a column is asked for. Of one that is still
    recorded, under the name that it will have, there are the rows that stood on the disk when it
    was opened.

    Parameters
    ----------
    recording
        A log, a CSV, Parquet, MAT or HDF5 file or its YAML description; or several logs of a run,
        their folder, or the run's name.
    whole_run
        A log stands for all logs of its run in its folder.

    Returns
    -------
    Log
        Columns as arrays (N,) by their names, with units.

    Raises
    ------
    DataError
        With file, place and value, for whatever cannot be used.
    """
    from motorctl.api.log_columns import ForeignColumns, LogColumns, UnfinishedColumns
    from motorctl.log import read_recording
    from motorctl.log.open_table import is_unfinished
    from motorctl.log.partial import SUFFIX
    from motorctl.log.run_parts import open_recorded
    from motorctl.log.run_table import RunTable
    from motorctl.log.table_parquet import ParquetTable

    given = [recording] if isinstance(recording, str | os.PathLike) else list(recording)
    paths = [Path(path) for path in given]
    first = paths[0]
    if len(paths) == 1 and not first.exists():
        beside = first.with_name(first.name + SUFFIX)  # its log while it is recorded
        paths = [beside] if beside.exists() else paths
        first = paths[0]
    if len(paths) == 1 and first.is_file() and is_unfinished(first):
        return Log(paths, whole_run, UnfinishedColumns(first))
    if first.suffix.lower() not in (".yaml", ".yml"):
        table = open_recorded(paths, whole_run)
        if isinstance(table, RunTable):
            return Log(paths, whole_run, LogColumns(table, table.parts))
        if isinstance(table, ParquetTable) and table.metadata:
            return Log(paths, whole_run, LogColumns(table, [table]))
    read = read_recording(paths, gaps="keep", whole_run=whole_run)
    return Log(paths, whole_run, ForeignColumns(read))


def _period_s(time_s: Array) -> float:
    return float(np.median(np.diff(time_s)))
