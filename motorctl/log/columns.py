"""The columns of a log: their names and types, derived from the sample."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.log.sample import AXIS_FIELDS, TICK_FIELDS, Signal

METADATA_KEY = b"motorctl"
AXIS_SIGNALS = tuple(field.name for field in AXIS_FIELDS if not field.per_parameter)
"""Signals of an axis that are one number a tick each."""
(THETA,) = (field.name for field in AXIS_FIELDS if field.per_parameter)
POSITION = ".position_m"
"""How the column of an axis' position ends; what stands before it is the axis' name."""


def axes_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return the axes that columns are of, in their order."""
    return tuple(name.removesuffix(POSITION) for name in names if name.endswith(POSITION))


@dataclass(frozen=True)
class LogAxis:
    """An axis of a log: its name, and the full names of the parameters in its theta."""

    name: str
    theta_names: tuple[str, ...]
    dual_drive: bool = False
    """Two motors and encoders drive it: it has columns of its skew."""
    learning: bool = False
    """It may get a learned feedforward, and has a column of it."""
    units: AxisUnits = LINEAR
    theta_units: tuple[str, ...] = ()
    """Of the parameters, of a linear axis, in the order of their names; empty: nobody told them."""


@dataclass(frozen=True)
class Column:
    """One column of a log, and where in the sample its values stand."""

    name: str
    field: Signal
    axis: int | None = None
    """Which axis of the samples; None for what is once a tick."""
    entry: int | None = None
    """Which entry of theta_hat."""
    unit: str = ""
    """Of its values on this axis; empty: a count, or a code."""

    @property
    def dtype(self) -> np.dtype[np.generic]:
        """Type of its values."""
        return np.dtype(self.field.dtype)


def log_columns(axes: Sequence[LogAxis]) -> tuple[Column, ...]:
    """Return the columns of a log of `axes`, in the order in which they stand in the file."""
    columns = [Column(field.name, field, unit=field.unit) for field in TICK_FIELDS]
    for j, axis in enumerate(axes):
        for field in AXIS_FIELDS:
            if not field.is_recorded(dual_drive=axis.dual_drive, learning=axis.learning):
                continue
            name = f"{axis.name}.{field.name}"
            if field.per_parameter:
                told = axis.theta_units or ("",) * len(axis.theta_names)
                thetas = zip(axis.theta_names, map(axis.units.words, told), strict=True)
                columns += [
                    Column(f"{name}_{theta}", field, j, k, unit)
                    for k, (theta, unit) in enumerate(thetas)
                ]
            else:
                columns.append(Column(name, field, j, unit=axis.units.words(field.unit)))
    return tuple(columns)


def log_schema(axes: Sequence[LogAxis], metadata: bytes) -> pa.Schema:
    """Return the Arrow schema of a log.

    Parameters
    ----------
    axes
        Whose columns follow those of the tick.
    metadata
        The JSON document under the key `motorctl`.

    Returns
    -------
    pa.Schema
        Each column carries its description, and its unit where it has one.
    """
    fields = [
        pa.field(
            column.name,
            pa.from_numpy_dtype(column.dtype),
            nullable=False,
            metadata={
                key: told
                for key, told in (("unit", column.unit), ("description", column.field.description))
                if told
            },
        )
        for column in log_columns(axes)
    ]
    return pa.schema(fields, metadata={METADATA_KEY: metadata})
