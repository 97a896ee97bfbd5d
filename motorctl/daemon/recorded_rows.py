"""Rows of a log that a daemon still records, as a log of their own."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.daemon.client import Client
from motorctl.errors import RunError
from motorctl.log.partial import SUFFIX, PartialFile

ON_DISK_S = 1.5
"""How long after a row it is on the disk [s]: the recorder writes once a second."""
LATE_S = 10.0
"""How much later than that a disk that is busy may have it [s]. Longer keeps who waits for one that
hangs, shorter loses motions that were run. By hand."""
LOOK_S = 0.2


def partial_log(client: Client) -> Path:
    """Return the file that a daemon records into; raises RunError where it records nothing."""
    recording = client.ask("status")["recording"]
    if not recording["file"]:
        raise RunError("the daemon records nothing: what it measured is read from its log")
    file = Path(recording["file"])
    return file.with_name(file.name + SUFFIX)


def cut_rows(partial: Path, first_tick: int, log: Path, last_tick: int | None = None) -> Path:
    """Write the rows of a log that is still recorded, from a tick on, as a log of their own.

    Parameters
    ----------
    partial
        As `partial_log` tells it.
    first_tick
        The first one that is wanted; rows of the same batch before it come along.
    log
        The new file.
    last_tick
        One that has to be among them; None: as many as there are.

    Raises
    ------
    RunError
        Where there are none, or the last one is not on the disk after some seconds more.
    """
    deadline = time.monotonic() + LATE_S
    while True:
        kept, metadata = _rows_from(partial, first_tick)
        reached = int(kept[-1].column("tick")[-1].as_py()) if kept else -1
        if kept and reached >= (last_tick or first_tick):
            break
        if time.monotonic() > deadline:
            missing = "has no row since the motion began"
            if kept:
                missing = f"ends at tick {reached}, before the motion did at {last_tick}"
            raise RunError(f"{partial}: {missing}: the disk does not keep up")
        time.sleep(LOOK_S)
    table = pa.Table.from_batches(kept).replace_schema_metadata(metadata)
    pq.write_table(table, log, write_page_checksum=True)
    return log


def _rows_from(partial: Path, first_tick: int) -> tuple[list[pa.RecordBatch], Any]:
    """Return the batches that reach a tick or come after it, and the file's metadata."""
    source = PartialFile(partial)
    try:
        kept = []
        for batch in source.batches():
            ticks = batch.column("tick")
            if len(ticks) and ticks[len(ticks) - 1].as_py() >= first_tick:
                kept.append(batch)
        return kept, source.schema.metadata
    finally:
        source.close()
