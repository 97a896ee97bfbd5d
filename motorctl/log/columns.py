"""The columns of a log: their names and types, derived from the sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from motorctl.log.sample import TICK_SAMPLE, axis_sample

METADATA_KEY = b"motorctl"
THETA = "theta_hat"
AXIS_SIGNALS = tuple(name for name in axis_sample(1).names or () if name != THETA)
"""Signals of an axis that are one number a tick each."""
TICK_SIGNALS = tuple(TICK_SAMPLE.names or ())


@dataclass(frozen=True)
class LogAxis:
    """An axis of a log: its name, and the full names of the parameters in its theta."""

    name: str
    theta_names: tuple[str, ...]


@dataclass(frozen=True)
class Column:
    """One column of a log, and where in the sample its values stand."""

    name: str
    dtype: np.dtype[np.generic]
    field: str
    axis: int | None
    """Which axis of the samples; None for what is once a tick."""
    entry: int | None = None
    """Which entry of theta_hat."""


def log_columns(axes: Sequence[LogAxis]) -> tuple[Column, ...]:
    """Return the columns of a log of `axes`, in the order in which they stand in the file."""
    columns = [Column(name, TICK_SAMPLE[name], name, None) for name in TICK_SIGNALS]
    record = axis_sample(1)
    for j, axis in enumerate(axes):
        for name in record.names or ():
            if name == THETA:
                columns += [
                    Column(f"{axis.name}.{THETA}_{theta}", np.dtype("f8"), THETA, j, k)
                    for k, theta in enumerate(axis.theta_names)
                ]
            else:
                columns.append(Column(f"{axis.name}.{name}", record[name], name, j))
    return tuple(columns)


def log_schema(axes: Sequence[LogAxis], metadata: bytes) -> pa.Schema:
    """Return the Arrow schema of a log; `metadata` is the JSON document under the key motorctl."""
    fields = [
        pa.field(column.name, pa.from_numpy_dtype(column.dtype), nullable=False)
        for column in log_columns(axes)
    ]
    return pa.schema(fields, metadata={METADATA_KEY: metadata})
