"""Write a log in another format."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
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
from motorctl.extras import require
from motorctl.log.columns import METADATA_KEY
from motorctl.log.export_mcap import write_mcap
from motorctl.log.folder import EXPORT_SUFFIX
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.run_parts import open_recorded
from motorctl.log.run_table import RunTable
from motorctl.log.table import Table
from motorctl.log.table_mat import METADATA_VARIABLE
from motorctl.log.table_parquet import ParquetTable
from motorctl.replacing import refuse_what_is_there

Format = Literal["csv", "parquet", "mat", "mcap"]
Progress = Callable[[float], None]
"""Told the share that is done, 0 to 1."""

_BATCH_ROWS = 1 << 14


def export(
    paths: Sequence[Path],
    to: Format,
    out: Path | None,
    progress: Progress,
    whole_run: bool = False,
    *,
    replace: bool = False,
) -> Path:
    """Write a log, or several of one run as one file, as CSV, MAT, MCAP or plain Parquet.

    CSV, MCAP and Parquet take constant memory; MAT (version 5) holds all at once. The Parquet is
    compressed with snappy and has plain encodings: what other programs read everywhere. In MAT an
    axis is a struct with the signals as fields, in MCAP a topic with JSON that Foxglove plots.

    Parameters
    ----------
    paths
        The log; or the logs of one run, their folder, or the run's name.
    to
        The format.
    out
        The new file; None: the log's name with the format's suffix.
    progress
        Called with the share that is done, 0 to 1.
    whole_run
        The log stands for all of its run that are in its folder.
    replace
        Write over a file that is there already.

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
    if to == "mcap":
        require("log export --to mcap", "mcap", "mcap")
    table = open_recorded(paths, whole_run)
    if not isinstance(table, ParquetTable | RunTable):
        raise DataError(f"{table.path}: is a {table.kind} file; only logs (Parquet) are exported")
    parts = table.parts if isinstance(table, RunTable) else [table]
    target = out or _default(table, to)
    if target.exists() and any(target.samefile(part.path) for part in parts):
        raise UsageError(
            f"{target}: the export would overwrite the log; name another file with --out"
        )
    refuse_what_is_there(target, replace=replace)
    draft = target.with_name(target.name + ".tmp")
    try:
        if to == "mat":
            _to_mat(table, parts, draft, progress)
        elif to == "mcap":
            write_mcap(table, parts, draft, progress)
        else:
            _in_batches(table, parts, draft, to, progress)
        draft.replace(target)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UsageError(f"{target}: cannot be written from {table.path}: {error}") from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
    return target


def _default(table: ParquetTable | RunTable, to: Format) -> Path:
    suffix = EXPORT_SUFFIX if to == "parquet" else f".{to}"
    if isinstance(table, ParquetTable):
        return table.path.with_suffix(suffix)
    numbers = table.metadata["part"]
    return table.path.with_name(f"{table.path.name}-parts-{numbers[0]}-{numbers[-1]}{suffix}")


def _in_batches(
    table: Table, parts: Sequence[ParquetTable], draft: Path, to: Format, progress: Progress
) -> None:
    schema = parts[0].schema
    schema = schema.with_metadata(
        {**(schema.metadata or {}), METADATA_KEY: json.dumps(table.metadata).encode()}
    )
    rows = sum(part.rows for part in parts)
    writer: Any
    if to == "csv":
        writer = pa.csv.CSVWriter(str(draft), schema)
    else:
        writer = pq.ParquetWriter(draft, schema, compression="snappy", write_page_checksum=True)
    done = 0
    with writer:
        for part in parts:
            with OpenedParquet(part.path) as log:
                for batch in log.batches(_BATCH_ROWS):
                    writer.write_batch(batch.cast(schema))
                    done += batch.num_rows
                    progress(done / rows)


def _to_mat(table: Table, parts: Sequence[ParquetTable], draft: Path, progress: Progress) -> None:
    variables: dict[str, Any] = {METADATA_VARIABLE: json.dumps(table.metadata)}
    for done, name in enumerate(table.names, 1):
        values = np.concatenate([part.column(name) for part in parts])
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
