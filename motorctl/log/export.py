"""Write a log in another format."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from scipy.io import savemat
from scipy.io.matlab import MatWriteError

from motorctl.errors import DataError, UsageError
from motorctl.log.open_table import open_table
from motorctl.log.table_mat import METADATA_VARIABLE
from motorctl.log.table_parquet import ParquetTable

Format = Literal["csv", "parquet", "mat"]
Progress = Callable[[float], None]
"""Told the share that is done, 0 to 1."""

_BATCH_ROWS = 1 << 14


def export(path: Path, to: Format, out: Path | None, progress: Progress) -> Path:
    """Write a log as CSV, MAT (version 5) or plain Parquet.

    CSV and Parquet take constant memory. The Parquet is compressed with snappy and has plain
    encodings: what other programs read everywhere. In MAT an axis is a struct with the signals
    as fields.

    Parameters
    ----------
    path
        The log.
    to
        The format.
    out
        The new file; None: the log's name with the format's suffix.
    progress
        Called with the share that is done, 0 to 1.

    Returns
    -------
    Path
        The new file.

    Raises
    ------
    DataError
        Where the log cannot be read.
    UsageError
        Where the new file cannot be written.
    """
    table = open_table(path)
    if not isinstance(table, ParquetTable):
        raise DataError(f"{path}: is a {table.kind} file; only logs (Parquet) are exported")
    target = out or _default(path, to)
    if target.exists() and target.samefile(path):
        raise UsageError(
            f"{target}: the export would overwrite the log; name another file with --out"
        )
    draft = target.with_name(target.name + ".tmp")
    try:
        with pq.ParquetFile(path) as log:
            if to == "mat":
                _to_mat(table, log, draft, progress)
            else:
                _in_batches(log, draft, to, progress)
        draft.replace(target)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UsageError(f"{target}: cannot be written from {path}: {error}") from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
    return target


def _default(path: Path, to: Format) -> Path:
    return path.with_suffix(".export.parquet" if to == "parquet" else f".{to}")


def _in_batches(log: pq.ParquetFile, draft: Path, to: Format, progress: Progress) -> None:
    schema, rows = log.schema_arrow, log.metadata.num_rows
    writer: Any
    if to == "csv":
        writer = pa.csv.CSVWriter(str(draft), schema)
    else:
        writer = pq.ParquetWriter(draft, schema, compression="snappy")
    done = 0
    with writer:
        for batch in log.iter_batches(batch_size=_BATCH_ROWS):
            writer.write_batch(batch.cast(schema))
            done += batch.num_rows
            progress(done / rows)


def _to_mat(table: ParquetTable, log: pq.ParquetFile, draft: Path, progress: Progress) -> None:
    variables: dict[str, Any] = {METADATA_VARIABLE: json.dumps(table.metadata)}
    for done, name in enumerate(table.names, 1):
        values = np.array(log.read(columns=[name]).column(name).to_numpy())
        axis, dot, signal = name.rpartition(".")
        if dot:
            variables.setdefault(axis, {})[signal] = values
        else:
            variables[name] = values
        progress(done / len(table.names))
    try:
        savemat(draft, variables, appendmat=False, long_field_names=True, oned_as="column")
    except MatWriteError as error:
        raise UsageError(f"{table.path}: too large for a MAT file: {error}; use csv") from error
