"""Say what is in a recording, in constant memory where it is a log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.errors import DataError
from motorctl.log.convert import load_metadata
from motorctl.log.open_table import is_unfinished, open_table
from motorctl.log.partial import PartialFile
from motorctl.log.read import read_recording
from motorctl.log.sample import FaultCause
from motorctl.log.table_parquet import ParquetTable

_FAULT = ".fault"
_POSITION = ".position_m"
_MOST_FAULTS = 50


@dataclass(frozen=True)
class Fault:
    """An axis that went into a fault."""

    time_s: float
    axis: str
    cause: str


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
            scan = _scan(source.batches(), source.schema.names)
            notes = ["not finished; to make it a log: motorctl log recover"]
            notes += [f"{source.given_up_bytes} bytes of it are torn"] if source.torn else []
            return _of_log(path, source.schema, scan, finished=False, notes=notes)
        finally:
            source.close()
    if path.suffix.lower() not in (".yaml", ".yml"):
        table = open_table(path)
        if isinstance(table, ParquetTable) and table.metadata:
            return _of_log(path, table.schema, _scan_log(path, table.names), True, [])
    return _of_recording(path)


@dataclass
class _Scan:
    rows: int
    begin_s: float | None
    end_s: float | None
    faults: list[Fault]


def _scan_log(path: Path, names: Iterable[str]) -> _Scan:
    columns = [n for n in names if n in ("tick", "time_s") or n.endswith(_FAULT)]
    try:
        with pq.ParquetFile(path) as log:
            return _scan(log.iter_batches(columns=columns), columns)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(f"{path}: a damaged log: {error}") from error


def _scan(batches: Iterable[pa.RecordBatch], names: Iterable[str]) -> _Scan:
    found = _Scan(0, None, None, [])
    before = dict.fromkeys((n for n in names if n.endswith(_FAULT)), 0)
    for batch in batches:
        time_s = batch.column("time_s").to_numpy()
        if len(time_s) == 0:
            continue
        found.rows += len(time_s)
        found.begin_s = float(time_s[0]) if found.begin_s is None else found.begin_s
        found.end_s = float(time_s[-1])
        for name in before:
            fault = batch.column(name).to_numpy()
            changed = np.flatnonzero(np.diff(fault, prepend=before[name]))
            found.faults += [
                Fault(float(time_s[k]), name.removesuffix(_FAULT), _cause(int(fault[k])))
                for k in changed
                if fault[k] != FaultCause.NONE
            ]
            before[name] = int(fault[-1])
        del found.faults[_MOST_FAULTS:]
    return found


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
        axes=tuple(n.removesuffix(_POSITION) for n in schema.names if n.endswith(_POSITION)),
        columns=tuple(schema.names),
        faults=tuple(sorted(scan.faults, key=lambda fault: fault.time_s)),
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
        metadata=dict(recording.metadata),
        notes=recording.notes,
    )
