"""Say what is in a recording, in constant memory where it is a log."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from motorctl.log.columns import axes_of
from motorctl.log.convert import ROW_GROUP_ROWS, load_metadata
from motorctl.log.open_table import is_unfinished, open_table
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.partial import PartialFile
from motorctl.log.read import read_recording
from motorctl.log.run_parts import open_recorded
from motorctl.log.run_table import RunTable
from motorctl.log.sample import FaultCause, SampleFlag, without_sample
from motorctl.log.table_parquet import ParquetTable

_FAULT, _FLAGS, _DEVICE = ".fault", ".flags", ".device_status"
_MOST_FAULTS = 50


@dataclass(frozen=True)
class Fault:
    """An axis that went into a fault."""

    time_s: float
    axis: str
    cause: str
    device: tuple[str, ...]
    """What its driver told in that tick, and in those without a sample right before it."""


@dataclass(frozen=True)
class LogInfo:
    """What is in a recording."""

    path: str
    finished: bool
    """False: the partial file of a recording that was not closed."""
    size_bytes: int
    rows: int
    sample_rate_hz: float | None
    begin_s: float | None
    end_s: float | None
    axes: tuple[str, ...]
    columns: tuple[str, ...]
    """Of a log; a foreign recording's are in its description."""
    faults: tuple[Fault, ...]
    """The first ones."""
    missed: dict[str, int]
    """Of each axis, how many rows had no new sample of its device."""
    metadata: dict[str, Any]
    """A log's own; `timing` of one in virtual time is what was measured while simulating."""
    notes: tuple[str, ...]


def describe(path: Path) -> LogInfo:
    """Describe a log, the partial file of one, or a foreign recording.

    Raises DataError where it is none of them.
    """
    if is_unfinished(path):
        source = PartialFile(path)
        try:
            scan = _scan(source.batches(), source.schema.names, _statuses(source.schema))
            notes = ["not finished; `motorctl log recover` makes it a log"]
            if source.torn:
                notes.append(f"{source.given_up_bytes} bytes are damaged and were left out")
            return _of_log(path, source.schema, scan, finished=False, notes=notes)
        finally:
            source.close()
    if path.suffix.lower() not in (".yaml", ".yml"):
        table = open_table(path)
        if isinstance(table, ParquetTable) and table.metadata:
            scan = _scan_logs([path], table.names, _statuses(table.schema))
            return _of_log(path, table.schema, scan, True, [])
    return _of_recording(path)


def describe_run(paths: Sequence[Path], whole_run: bool = False) -> LogInfo:
    """Describe several logs of a run as one; which they are is said as in `open_recorded`.

    Raises DataError where they cannot be one recording.
    """
    table = open_recorded(paths, whole_run)
    if not isinstance(table, RunTable):
        return describe(table.path)
    schema = table.parts[0].schema
    paths = [part.path for part in table.parts]
    scan = _scan_logs(paths, table.names, _statuses(schema))
    info = _of_log(paths[-1], schema, scan, finished=True, notes=list(table.notes))
    return replace(
        info,
        path=str(table.path),
        size_bytes=sum(path.stat().st_size for path in paths),
        metadata=table.metadata,
    )


@dataclass
class _Scan:
    rows: int
    begin_s: float | None
    end_s: float | None
    faults: list[Fault]
    missed: dict[str, int]


def _statuses(schema: pa.Schema) -> dict[int, str]:
    """Return the names of the bits of `device_status`; none where a log has no such column."""
    names = load_metadata(schema).get("device_statuses")
    if not (isinstance(names, dict) and any(n.endswith(_DEVICE) for n in schema.names)):
        return {}
    return {int(bit): str(name) for bit, name in names.items() if str(bit).isdecimal()}


def _scan_logs(paths: Iterable[Path], names: Iterable[str], statuses: Mapping[int, str]) -> _Scan:
    wanted = (_FAULT, _FLAGS, _DEVICE)
    columns = [n for n in names if n in ("tick", "time_s") or n.endswith(wanted)]
    batches = (batch for path in paths for batch in _batches(path, columns))
    return _scan(batches, columns, statuses)


def _batches(path: Path, columns: list[str]) -> Iterator[pa.RecordBatch]:
    with OpenedParquet(path) as log:
        yield from log.batches(ROW_GROUP_ROWS, columns)


def _scan(
    batches: Iterable[pa.RecordBatch], names: Iterable[str], statuses: Mapping[int, str]
) -> _Scan:
    names = list(names)
    axes = [n.removesuffix(_FAULT) for n in names if n.endswith(_FAULT)]
    found = _Scan(0, None, None, [], dict.fromkeys(axes, 0))
    before = dict.fromkeys(axes, 0)
    told = dict.fromkeys(axes, 0)
    for batch in batches:
        time_s = batch.column("time_s").to_numpy()
        if len(time_s) == 0:
            continue
        found.rows += len(time_s)
        found.begin_s = float(time_s[0]) if found.begin_s is None else found.begin_s
        found.end_s = float(time_s[-1])
        for axis in axes:
            fault = batch.column(axis + _FAULT).to_numpy()
            flags = batch.column(axis + _FLAGS).to_numpy() if axis + _FLAGS in names else None
            device = None
            if flags is not None:
                found.missed[axis] += int(np.count_nonzero(without_sample(flags)))
                if statuses:
                    device = _Device(batch.column(axis + _DEVICE).to_numpy(), flags, told[axis])
            for k in np.flatnonzero(np.diff(fault, prepend=before[axis])).tolist():
                if fault[k] != FaultCause.NONE:
                    word = device.told_until(k) if device else 0
                    bits = tuple(name for bit, name in statuses.items() if word & bit)
                    found.faults.append(Fault(float(time_s[k]), axis, _cause(int(fault[k])), bits))
            before[axis] = int(fault[-1])
            told[axis] = device.left_over() if device else 0
        del found.faults[_MOST_FAULTS:]
    return found


class _Device:
    """What a driver told of an axis in a batch of rows."""

    def __init__(self, words: NDArray[np.int64], flags: NDArray[np.int64], before: int) -> None:
        self._held = flags & int(SampleFlag.HELD) > 0
        self._words = words
        self._before = before  # in the ticks without a sample that the last batch ended with

    def told_until(self, row: int) -> int:
        """Return all bits of a row, and of those without a sample right before it."""
        sampled = np.flatnonzero(~self._held[:row])
        first = sampled[-1] + 1 if len(sampled) else 0
        word = int(np.bitwise_or.reduce(self._words[first : row + 1]))
        return word if len(sampled) else word | self._before

    def left_over(self) -> int:
        """Return the bits of the rows without a sample at the end."""
        last = len(self._held) - 1
        return self.told_until(last) if self._held[last] else 0


def _cause(code: int) -> str:
    names = {cause.value: cause.name for cause in FaultCause}
    return names.get(code, f"unknown cause {code}")


def _of_log(
    path: Path, schema: pa.Schema, scan: _Scan, finished: bool, notes: list[str]
) -> LogInfo:
    metadata = load_metadata(schema)
    if isinstance(virtual := metadata.get("virtual_time"), dict):
        # The rows of virtual time are the same in every run: zeros stand where times would.
        measured = {"turnaround": virtual.get("turnaround"), "lateness": None}
        metadata["timing"] = (metadata.get("timing") or {}) | measured
        notes = [*notes, "virtual time: the turnaround is the simulation's; nothing is ever late"]
    rate = metadata.get("rate_hz")
    return LogInfo(
        path=str(path),
        finished=finished,
        size_bytes=path.stat().st_size,
        rows=scan.rows,
        sample_rate_hz=float(rate) if isinstance(rate, int | float) else None,
        begin_s=scan.begin_s,
        end_s=scan.end_s,
        axes=axes_of(schema.names),
        columns=tuple(schema.names),
        faults=tuple(sorted(scan.faults, key=lambda fault: fault.time_s)),
        missed=scan.missed,
        metadata=metadata,
        notes=tuple(notes),
    )


def _of_recording(path: Path) -> LogInfo:
    recording = read_recording(path)
    return LogInfo(
        path=str(path),
        finished=True,
        size_bytes=path.stat().st_size,
        rows=len(recording.time_s),
        sample_rate_hz=recording.sample_rate_hz,
        begin_s=float(recording.time_s[0]),
        end_s=float(recording.time_s[-1]),
        axes=tuple(recording.axes),
        columns=(),
        faults=(),
        missed={},
        metadata=dict(recording.metadata),
        notes=recording.notes,
    )
