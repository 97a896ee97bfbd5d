"""A log as MCAP: a topic an axis and one of the loop, JSON with a schema, which Foxglove plots."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from motorctl.errors import DataError
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.table import Table
from motorctl.log.table_parquet import ParquetTable, require_numbers
from motorctl.printable import one_line
from motorctl.version import VERSION

LOOP = "loop"
"""Topic of what is sampled once a tick."""
TIME = "time_s"
NS = 1e9
LAST_TIME_S = 9e9
"""By hand, 285 years: nanoseconds that 63 bits have, as numpy and most readers of MCAP count."""
NAMED = {"state": "states", "fault": "faults"}
"""Codes that are also told by their name, and where a log's metadata have the names."""
BATCH_ROWS = 1 << 12


@dataclass(frozen=True)
class _Topic:
    """Columns that make one message a row."""

    name: str
    columns: Mapping[str, str]
    """By the message's key."""

    def schema(self, table: pa.Schema) -> dict[str, Any]:
        """Return the JSON Schema of a message."""
        properties = {}
        for key, column in self.columns.items():
            field = table.field(column)
            told = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
            unit = f" [{told['unit']}]" if "unit" in told else ""
            kind = "integer" if pa.types.is_integer(field.type) else "number"
            properties[key] = {"type": kind, "description": told.get("description", key) + unit}
            if key in NAMED:
                properties[f"{key}_name"] = {"type": "string", "description": f"{key}, in words"}
        return {"title": f"motorctl.{self.name}", "type": "object", "properties": properties}


def write_mcap(
    table: Table, parts: Sequence[ParquetTable], draft: Path, progress: Callable[[float], None]
) -> None:
    """Write a log as MCAP, in constant memory.

    The log's own time since the first tick is each message's, in nanoseconds. Numbers that are not
    finite are left out: JSON knows none. The metadata record `motorctl` has the log's metadata.

    Parameters
    ----------
    table
        The log, or the run.
    parts
        Its files.
    draft
        The new file.
    progress
        Told the share that is done, 0 to 1.

    Raises
    ------
    DataError
        Where it has no time, a time that MCAP cannot have, or a column of something else than
        numbers.
    """
    from mcap.writer import Writer

    topics = _topics(table, parts[0].schema)
    rows, done = sum(part.rows for part in parts), 0
    with draft.open("wb") as file:
        writer = Writer(file)
        writer.start(library=f"motorctl {VERSION}")
        writer.add_metadata("motorctl", {"json": json.dumps(table.metadata)})
        channels = []
        for topic in topics:
            schema = json.dumps(topic.schema(parts[0].schema)).encode()
            number = writer.register_schema(f"motorctl.{topic.name}", "jsonschema", schema)
            channels.append(writer.register_channel(f"/{topic.name}", "json", number))
        names = {key: _names(table, where) for key, where in NAMED.items()}
        for part in parts:
            with OpenedParquet(part.path) as log:
                for batch in log.batches(BATCH_ROWS):
                    times = _times_ns(table, batch, done)
                    for topic, channel in zip(topics, channels, strict=True):
                        for t, message in zip(times, _messages(topic, batch, names), strict=True):
                            writer.add_message(channel, t, message, t)
                    done += batch.num_rows
                    progress(done / rows)
        writer.finish()  # type: ignore[no-untyped-call]


def _topics(table: Table, schema: pa.Schema) -> list[_Topic]:
    """Return the loop's topic and one an axis. Raises DataError where the file is no log."""
    if TIME not in schema.names:
        raise DataError(f"{table.path}: has no column '{TIME}': only logs are exported to MCAP")
    require_numbers(table.path, schema, schema.names)
    grouped: dict[str, dict[str, str]] = {}
    for name in schema.names:
        axis, _, signal = name.rpartition(".")
        grouped.setdefault(axis or LOOP, {})[signal] = name
    return [_Topic(name, columns) for name, columns in grouped.items()]


def _times_ns(table: Table, batch: pa.RecordBatch, before: int) -> list[int]:
    time_s = np.asarray(batch.column(TIME).to_numpy(zero_copy_only=False), np.float64)
    wrong = np.flatnonzero(~((time_s >= 0.0) & (time_s <= LAST_TIME_S)))
    if len(wrong):
        k = int(wrong[0])
        raise DataError(
            f"{table.path}: row {before + k + 1} has the time {time_s[k]:g} s; MCAP counts "
            f"nanoseconds from 0 on, up to {LAST_TIME_S:g} s: only logs with such times are "
            "exported to it"
        )
    times: list[int] = np.round(time_s * NS).astype(np.int64).tolist()
    return times


def _messages(
    topic: _Topic, batch: pa.RecordBatch, names: Mapping[str, Mapping[int, str]]
) -> Iterator[bytes]:
    values: dict[str, list[Any]] = {}
    finite = True
    for key, column in topic.columns.items():
        array = batch.column(column).to_numpy(zero_copy_only=False)
        finite = finite and bool(np.all(np.isfinite(array)))
        values[key] = array.tolist()
        if key in NAMED:
            known = names[key]
            values[f"{key}_name"] = [known.get(code, str(code)) for code in values[key]]
    keys = list(values)
    for row in zip(*values.values(), strict=True):
        message = dict(zip(keys, row, strict=True))
        if not finite:
            message = {k: v for k, v in message.items() if isinstance(v, str) or np.isfinite(v)}
        yield json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def _names(table: Table, key: str) -> dict[int, str]:
    """Return the names of codes as a log's metadata have them: by number, in small letters.

    Raises DataError where what is there is no such table.
    """
    told = table.metadata.get(key)
    named = {} if told is None else told
    try:
        return {int(code): str(name).lower() for code, name in named.items()}
    except (AttributeError, ValueError):
        raise DataError(
            f"{table.path}: its metadata's '{key}' is {one_line(json.dumps(told)[:80])}, should be "
            'names by their numbers, as {"0": "off"}: it is no log that motorctl wrote; '
            "`motorctl log export --to csv` exports it without names"
        ) from None
