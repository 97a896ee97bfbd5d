"""From the partial file to the finished log: one Parquet file, in constant memory."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.log.columns import METADATA_KEY
from motorctl.log.partial import Ending, PartialFile, values_of
from motorctl.log.synced import sync
from motorctl.log.timing import TimingSummary

ROW_GROUP_ROWS = 1 << 16
"""Fixed, so that the file does not depend on when the recorder came to write."""


@dataclass(frozen=True)
class Converted:
    """What stands in a log made from a partial file."""

    rows: int
    given_up_bytes: int
    """How much of the partial file is damaged."""
    whole: bool
    """The recording was closed, and every row of it is there."""


def load_metadata(schema: pa.Schema) -> dict[str, Any]:
    """Return the JSON document that stands in a schema's metadata; empty where there is none."""
    try:
        document = json.loads((schema.metadata or {}).get(METADATA_KEY, b"{}"))
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def convert(partial: Path, target: Path, without_end: Mapping[str, Any]) -> Converted:
    """Write what is whole in a partial file as a log.

    The log appears under its name complete or not at all; the partial file is left alone.
    It goes to the disk piece by piece: one large write at the end would keep whoever records on
    the same disk waiting.

    Parameters
    ----------
    partial
        The partial file.
    target
        Name of the log.
    without_end
        Joins the metadata with which the recording began, where its own ending is not there or
        speaks of other rows.

    Raises
    ------
    DataError
        Where the partial file cannot be read.
    OSError
        Where the log cannot be written.
    """
    timing, given_up_bytes, ending = _scan(partial)
    source = PartialFile(partial)
    draft = target.with_name(target.name + ".tmp")
    try:
        opening = load_metadata(source.schema)
        summary = {"rows": timing.rows, "timing": timing.result()}
        whole = ending is not None and ending.rows == timing.rows
        metadata = opening | summary | dict(ending.metadata if ending and whole else without_end)
        schema = source.schema.with_metadata({METADATA_KEY: json.dumps(metadata).encode()})
        with _parquet_writer(draft, schema) as writer:
            for group in _row_groups(source, schema):
                writer.write_table(group, row_group_size=ROW_GROUP_ROWS)
                sync(draft)
        sync(draft)
        draft.replace(target)
        sync(target.parent)
    finally:
        source.close()
        with suppress(OSError):
            draft.unlink(missing_ok=True)
    return Converted(timing.rows, given_up_bytes, whole)


def _scan(partial: Path) -> tuple[TimingSummary, int, Ending | None]:
    source = PartialFile(partial)
    try:
        timing = TimingSummary()
        for batch in source.batches():
            timing.add(
                *(
                    values_of(batch.column(name))
                    for name in ("tick", "time_s", "lateness_s", "turnaround_s")
                )
            )
        return timing, source.given_up_bytes, source.ending
    finally:
        source.close()


def _parquet_writer(path: Path, schema: pa.Schema) -> pq.ParquetWriter:
    floats = [field.name for field in schema if pa.types.is_floating(field.type)]
    states = [f.name for f in schema if pa.types.is_integer(f.type) and f.name != "tick"]
    encoding = dict.fromkeys(floats, "BYTE_STREAM_SPLIT") | {"tick": "DELTA_BINARY_PACKED"}
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=3,
        use_dictionary=states,  # type: ignore[arg-type]
        column_encoding=encoding,
        write_page_checksum=True,  # else a flipped bit of incompressible numbers is taken for data
    )


def _row_groups(source: PartialFile, schema: pa.Schema) -> Iterator[pa.Table]:
    waiting: list[pa.RecordBatch] = []
    rows = 0
    for batch in source.batches():
        waiting.append(batch)
        rows += batch.num_rows
        while rows >= ROW_GROUP_ROWS:
            table = pa.Table.from_batches(waiting).replace_schema_metadata(schema.metadata)
            yield table.slice(0, ROW_GROUP_ROWS)
            waiting = table.slice(ROW_GROUP_ROWS).to_batches()
            rows -= ROW_GROUP_ROWS
    if rows:
        yield pa.Table.from_batches(waiting).replace_schema_metadata(schema.metadata)
