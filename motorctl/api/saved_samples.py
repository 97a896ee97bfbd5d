"""Write columns that were heard of a running machine as an ordinary log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log import LogAxis, LogWriter
from motorctl.log.columns import log_columns
from motorctl.log.sample import TICK_SAMPLE, axis_sample


def save_columns(
    path: Path,
    columns: Mapping[str, NDArray[Any]],
    axes: Sequence[LogAxis],
    metadata: Mapping[str, Any],
) -> Path:
    """Write a log of rows that stand in memory.

    Parameters
    ----------
    path
        The log, a .parquet file that is not there yet.
    columns
        Arrays of shape (N,) under the names that a log of these axes has, as `Samples` has them.
    axes
        Whose columns: `Samples.log_axes`.
    metadata
        What the log says of itself: `Samples.metadata`, and more.

    Returns
    -------
    Path
        The log.

    Raises
    ------
    UsageError
        Where the file cannot be made.
    RunError
        Where the disk refuses it.
    """
    rows = len(columns["tick"])
    ticks = np.zeros(rows, TICK_SAMPLE)
    parameters = max((len(axis.theta_names) for axis in axes), default=0)
    samples = np.zeros((rows, len(axes)), axis_sample(parameters))
    for column in log_columns(axes):
        values = columns[column.name]
        if column.axis is None:
            ticks[column.field.name] = values
        elif column.entry is None:
            samples[column.field.name][:, column.axis] = values
        else:
            samples[column.field.name][:, column.axis, column.entry] = values
    writer = LogWriter(path, metadata, axes)
    writer.append(ticks, samples)
    return writer.close()
