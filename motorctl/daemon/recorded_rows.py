"""Rows of a log that a daemon still records, as a log of their own."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.daemon.client import Client
from motorctl.errors import RunError
from motorctl.log.partial import SUFFIX, PartialFile

ON_DISK_S = 1.5
"""How long after a row it is on the disk [s]: the recorder writes once a second."""


def partial_log(client: Client) -> Path:
    """Return the file that a daemon records into; raises RunError where it records nothing."""
    recording = client.ask("status")["recording"]
    if not recording["file"]:
        raise RunError("the daemon records nothing: what it measured is read from its log")
    file = Path(recording["file"])
    return file.with_name(file.name + SUFFIX)


def cut_rows(partial: Path, first_tick: int, log: Path) -> Path:
    """Write the rows of a log that is still recorded, from a tick on, as a log of their own.

    Parameters
    ----------
    partial
        As `partial_log` tells it.
    first_tick
        The first one that is wanted; rows of the same batch before it come along.
    log
        The new file.

    Raises
    ------
    RunError
        Where there are none.
    """
    source = PartialFile(partial)
    try:
        kept = []
        for batch in source.batches():
            ticks = batch.column("tick")
            if len(ticks) and ticks[len(ticks) - 1].as_py() >= first_tick:
                kept.append(batch)
        if not kept:
            raise RunError(f"{partial}: has no row since the motion began")
        table = pa.Table.from_batches(kept).replace_schema_metadata(source.schema.metadata)
        pq.write_table(table, log)
    finally:
        source.close()
    return log
