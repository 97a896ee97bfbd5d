"""What the axes did in the tick of the fault and in the one before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.flight.records import FlightRecord
from motorctl.log.opened_parquet import OpenedParquet

SHOWN = ("reference_m", "position_m", "velocity_m_s", "following_error_m", "command_v")
"""Signals of an axis that say what it did."""


@dataclass(frozen=True)
class AxisMoment:
    """One axis in one tick."""

    state: str
    values: Mapping[str, float | None]
    """The signals of SHOWN; None where one is no finite number."""
    flags: tuple[str, ...]
    device: tuple[str, ...]


@dataclass(frozen=True)
class FaultMoment:
    """All axes right before the fault and in its tick."""

    time_s: float
    """Of the fault's tick [s since the first tick]."""
    before: Mapping[str, AxisMoment]
    at: Mapping[str, AxisMoment]


def read_rows(record: FlightRecord) -> pa.Table:
    """Return every row of a record. Raises DataError where the file cannot be read."""
    with OpenedParquet(record.path) as file:
        return file.table()


def axes_of(record: FlightRecord) -> list[str]:
    """Return the names of the machine's axes, in the configuration's order."""
    return list(record.metadata.get("axes", {}))


def fault_row(times_s: NDArray[np.float64], time_s: float) -> int:
    """Return the number of the row in which an axis tripped.

    Parameters
    ----------
    times_s
        Of the rows, shape (N,).
    time_s
        Of the fault. Half a period early still is its tick, for times that were rounded.
    """
    half_s = 0.5 * float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
    return min(int(np.searchsorted(times_s, time_s - half_s)), len(times_s) - 1)


def fault_moment(record: FlightRecord, rows: pa.Table) -> FaultMoment:
    """Return what the axes did when the first of them tripped.

    Parameters
    ----------
    record
        The record.
    rows
        Its rows, from `read_rows`.

    Raises
    ------
    DataError
        Where the record holds no rows.
    """
    times = rows["time_s"].to_numpy()
    if not len(times):
        raise DataError(f"{record.path}: holds no rows")
    at = fault_row(times, record.time_s)
    axes = axes_of(record)
    return FaultMoment(
        time_s=float(times[at]),
        before={axis: _axis(record.metadata, rows, axis, max(at - 1, 0)) for axis in axes},
        at={axis: _axis(record.metadata, rows, axis, at) for axis in axes},
    )


def _axis(metadata: Mapping[str, Any], rows: pa.Table, axis: str, row: int) -> AxisMoment:
    def value(signal: str) -> Any:
        return rows[f"{axis}.{signal}"][row].as_py()

    return AxisMoment(
        state=str(metadata["states"].get(str(value("state")), value("state"))).lower(),
        values={name: float(v) if np.isfinite(v := value(name)) else None for name in SHOWN},
        flags=_words(value("flags"), metadata["flags"]),
        device=_words(value("device_status"), metadata.get("device_statuses", {})),
    )


def _words(bits: int, names: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(name.lower() for bit, name in names.items() if int(bit) and bits & int(bit))
