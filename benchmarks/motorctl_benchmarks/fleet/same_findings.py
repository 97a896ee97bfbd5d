"""Whether two stores have the same findings, byte for byte but for when and where."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

WHEN = "written_utc"
WHERE = "source"


def digests(store: Path, *, but_where: bool = False) -> dict[str, str]:
    """Return a hash of what each file of a store holds, by its name.

    Parameters
    ----------
    store
        The folder of findings.
    but_where
        Leave out where the logs were, too: for logs that were read from elsewhere.
    """
    left_out = [WHEN, WHERE] if but_where else [WHEN]
    found = {}
    for path in sorted((store / "findings").glob("*/*.parquet")):
        table = pq.read_table(path, partitioning=None).drop_columns(left_out).combine_chunks()
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, table.schema) as stream:
            stream.write_table(table)
        found[f"{path.parent.name}/{path.name}"] = hashlib.sha256(sink.getvalue()).hexdigest()
    return found
