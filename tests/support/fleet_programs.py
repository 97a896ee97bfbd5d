"""Logs of a simulated axis that goes back and forth at chosen speeds, with forces of choice."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.signal import lfilter

from motorctl.fleet.head import identity_of
from motorctl.fleet.series import Seen
from motorctl.log.columns import METADATA_KEY
from motorctl_benchmarks.fleet.fleet_logs import write_log
from motorctl_benchmarks.fleet.fleet_machines import (
    DRIVE,
    FORCE_NOISE_V,
    LOG_S,
    NOISE_POLE,
    RATE_HZ,
    SEEN_NOISE_M,
    Machine,
    Run,
    draw_fleet,
)
from motorctl_benchmarks.fleet.fleet_physics import closed_loop

Array = NDArray[np.float64]
WAY_M, BEGIN_M, REST_S = 0.25, 0.01, 0.06
SOUND_MACHINE: Machine = draw_fleet(12, 20, 31)[5]


def back_and_forth(
    *speeds_m_s: float, acceleration_m_s2: float = 12.0
) -> tuple[Array, list[tuple[int, float]]]:
    """Return position, velocity, acceleration (3, N), and where ramps end, in which direction.

    The speeds are taken in turn, one a move.
    """
    count = int(LOG_S * RATE_HZ)
    v = np.zeros(count)
    ends = []
    begin, move = int(0.1 * RATE_HZ), 0
    while begin < count:
        speed, sign = speeds_m_s[move % len(speeds_m_s)], 1.0 - 2.0 * (move % 2)
        ramp = np.linspace(0.0, speed, int(speed / acceleration_m_s2 * RATE_HZ))
        even = np.full(int((WAY_M / speed - speed / acceleration_m_s2) * RATE_HZ), speed)
        shape = np.concatenate([ramp, even, ramp[::-1]])[: count - begin]
        v[begin : begin + len(shape)] = sign * shape
        ends.append((begin + len(ramp), sign))
        begin += len(shape) + int(REST_S * RATE_HZ)
        move += 1
    return np.array([BEGIN_M + np.cumsum(v) / RATE_HZ, v, np.gradient(v) * RATE_HZ]), ends


def ringing(ends: Sequence[tuple[int, float]], hz: float, size_v: float, for_s: float) -> Array:
    """Return the force of a load that rings after each ramp, (N,)."""
    since = np.arange(int(LOG_S * RATE_HZ)) / RATE_HZ
    force = np.zeros(len(since))
    for end, sign in ends:
        t = np.clip(since - end / RATE_HZ, 0.0, None)
        force += sign * size_v * np.exp(-t / for_s) * np.sin(2.0 * np.pi * hz * t)
    return force


def recorded(
    path: Path, goal: Array, force_v: Array | float = 0.0, finer_encoder: float = 1.0
) -> Seen:
    """Write a log of a sound machine on which a further force acts, with noise of its own."""
    rng = np.random.default_rng(list(path.name.encode()))
    count = goal.shape[1]
    gain = FORCE_NOISE_V * np.sqrt(1.0 - NOISE_POLE**2)
    noise = lfilter([gain], [1.0, -NOISE_POLE], rng.standard_normal(count))
    seen = SEEN_NOISE_M / finer_encoder * rng.standard_normal(count)
    axis = SOUND_MACHINE.axis
    drive = DRIVE._replace(resolution_m=DRIVE.resolution_m / finer_encoder)
    position, command, _ = closed_loop(goal, noise + force_v, seen, axis, axis, drive)
    run = Run(np.arange(count) / RATE_HZ, position, command, goal[0], goal[1], 0.0)
    write_log(path, SOUND_MACHINE, 0.0, run)
    return Seen(str(path), identity_of(str(path)))


def told_otherwise(seen: Seen, change: Callable[[dict[str, Any]], object]) -> Seen:
    """Change the configuration in a log, and return it."""
    table = pq.read_table(seen.source)
    document = json.loads(table.schema.metadata[METADATA_KEY])
    change(document["config"])
    told = table.replace_schema_metadata({METADATA_KEY: json.dumps(document)})
    pq.write_table(told, seen.source)
    return Seen(seen.source, identity_of(seen.source))


def with_rows_behind(seen: Seen, rows: int, group_rows: int, *, moving: bool) -> Seen:
    """Let rows follow whose commands are no numbers, at rest or not; whoever reads them is refused.

    Returned is one window of all of it.
    """
    table = pq.read_table(seen.source)
    count = table.num_rows
    columns = {
        name: np.concatenate([column, np.full(rows, column[-1])])
        for name in table.column_names
        for column in (table.column(name).to_numpy(),)
    }
    behind = np.arange(count, count + rows)
    columns["tick"][count:], columns["time_s"][count:] = behind, behind / RATE_HZ
    columns["x.command_v"][count:] = np.nan
    if moving:
        columns["x.position_m"][count:] += 1e-6 * np.arange(rows)
    longer = pa.table(columns).replace_schema_metadata(table.schema.metadata)
    pq.write_table(longer, seen.source, row_group_size=group_rows)
    return Seen(seen.source, identity_of(seen.source), 0.0, float(behind[-1]) / RATE_HZ)
