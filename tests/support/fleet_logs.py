"""Logs of a fleet for tests, each of the machine, day and run that a test asks for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from fit_plant import X_THETA, simulate

from motorctl.config import load
from motorctl.log.columns import METADATA_KEY
from motorctl.log.convert import ROW_GROUP_ROWS

GANTRY = "published_gantry"
RESOLUTION_M = 0.5e-6
SKIPPED_TICKS = 50
"""Before and after a rest: rows end elsewhere than they begin, and in motion."""


def plant_log(
    out: Path,
    *,
    seed: int = 0,
    theta: Sequence[float] = X_THETA,
    duration_s: float = 6.0,
    **told: Any,
) -> Path:
    """Write a log of the published gantry's X, from the plant that knows nothing of the model.

    Parameters
    ----------
    out
        The log.
    seed, theta, duration_s
        Of the plant, as `fit_plant.simulate` takes them.
    told
        What `told_anew` takes.
    """
    run = simulate(seed=seed, theta=theta, duration_s=duration_s, resolution=RESOLUTION_M)
    columns = {
        "tick": np.arange(len(run.time_s)),
        "time_s": run.time_s,
        "x.position_m": run.position,
        "x.command_v": run.command,
        "x.reference_m": run.reference,
        "x.reference_velocity_m_s": run.reference_velocity,
    }
    document = {"rate_hz": run.rate_hz, "config": load(GANTRY).resolved}
    raw = out.with_suffix(".raw")
    out.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(document)})
    pq.write_table(table, raw)
    told_anew(raw, out, **told)
    raw.unlink()
    return out


def told_anew(
    log: Path,
    out: Path,
    *,
    machine: str = "stage-1",
    host: str = "computer-1",
    started: datetime | str = "2026-03-01T06:00:00+00:00",
    repeats: int = 1,
    rest_s: float = 0.0,
    **told: Any,
) -> Path:
    """Write a log's rows as those of another machine, day or run, on the wall clock.

    Parameters
    ----------
    log
        The log whose rows it has.
    out
        The new log.
    machine, host, started
        What its metadata say.
    repeats
        How often its rows stand in it, one time after the other.
    rest_s
        How long its last row is held after each time.
    told
        More that its metadata say, as run and part.
    """
    table = pq.read_table(log)
    metadata = json.loads(table.schema.metadata[METADATA_KEY])
    metadata.pop("virtual_time", None)
    when = started.isoformat() if isinstance(started, datetime) else started
    metadata |= {"machine": machine, "host": {"name": host}, "started_utc": when, **told}
    moving = len(table)
    if rest_s:
        held = round(rest_s * metadata["rate_hz"])
        rows = np.concatenate([np.arange(len(table)), np.full(held, len(table) - 1)])
        table = table.take(pa.array(rows))
    ticks = np.arange(len(table))
    ticks[moving:] += SKIPPED_TICKS
    schema = table.schema.with_metadata({METADATA_KEY: json.dumps(metadata).encode()})
    out.parent.mkdir(parents=True, exist_ok=True)
    with pq.ParquetWriter(out, schema, compression="zstd", compression_level=1) as writer:
        left = None
        for k in range(repeats):
            tick = ticks + k * (len(ticks) + 2 * SKIPPED_TICKS)
            for name, values in (("tick", tick), ("time_s", tick / metadata["rate_hz"])):
                column = pa.array(values, table.schema.field(name).type)
                table = table.set_column(table.schema.get_field_index(name), name, column)
            both = table if left is None else pa.concat_tables([left, table])
            whole = len(both) - len(both) % ROW_GROUP_ROWS if k < repeats - 1 else len(both)
            if whole:
                writer.write_table(both.slice(0, whole).cast(schema), row_group_size=ROW_GROUP_ROWS)
            left = both.slice(whole).combine_chunks()
    return out
