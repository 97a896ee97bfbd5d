"""Logs of a simulated fleet, as a recorder of motorctl leaves them."""

from __future__ import annotations

import copy
import json
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.config import load
from motorctl.log.columns import METADATA_KEY
from motorctl.log.convert import ROW_GROUP_ROWS
from motorctl_benchmarks.fleet.fleet_machines import DRIVE, RATE_HZ, TRAVEL_M, Machine, Run

BEGAN = datetime(2025, 3, 3, tzinfo=UTC)
"""When the simulated fleet began."""


def configuration(machine: Machine) -> dict[str, Any]:
    """Return what a machine was commissioned with: its parameters, with the cogging found then."""
    plain = copy.deepcopy(_stage())
    axis = plain["axes"]["x"]
    true = machine.axis
    plain["name"] = machine.name
    plain["drivers"]["stage"]["plants"] = {}
    axis["encoder"] |= {"resolution_m": DRIVE.resolution_m, "counter_bits": 32}
    axis["limits"] |= {"travel_m": [-0.02, TRAVEL_M + 0.02], "max_velocity_m_s": 1.0}
    axis["homing"] = {"method": "absolute"}
    axis["program"] = "production"
    plain["programs"] = {
        "production": {
            "axis": "x", "kind": "back_and_forth", "start_m": 0.0, "distance_m": 0.1,
            "max_velocity_m_s": 0.5, "max_acceleration_m_s2": 12.0, "jerk_time_s": 0.008,
            "period_s": 1.6, "cycles": 1,
        }
    }  # fmt: skip
    axis["model"] = {
        "inertia": _term(true.inertia, 0.02, 1.0, 2.0),
        "viscous_friction": _term(true.viscous, 0.0, 3.0, 50.0),
        "coulomb_friction": _term(true.coulomb, 0.0, 2.0, 100.0)
        | {"slope_s_m": 1.0 / DRIVE.turn_m_s, "sign_shape": "tanh"},
        "offset": _term(true.offset, -1.0, 1.0, 500.0),
        "cogging": {"pitch_m": true.pitch_m, "orders": [1, 2]},
    }
    return plain


@cache
def _stage() -> dict[str, Any]:
    return dict(load("small_stage").resolved)


def _term(initial: float, low: float, high: float, covariance: float) -> dict[str, Any]:
    return {"initial": float(initial), "bounds": [low, high], "covariance": covariance}


def write_log(out: Path, machine: Machine, day: float, run: Run) -> None:
    """Write a log that began on a day of the fleet."""
    columns: dict[str, Any] = {
        "tick": np.arange(len(run.time_s)),
        "time_s": run.time_s,
        "x.position_m": run.position_m,
        "x.command_v": run.command_v,
        "x.reference_m": run.reference_m,
        "x.reference_velocity_m_s": run.reference_velocity_m_s,
    }
    document = {
        "machine": machine.name,
        "host": {"name": machine.name},
        "started_utc": (BEGAN + timedelta(days=day)).isoformat(),
        "rate_hz": RATE_HZ,
        "config": configuration(machine),
    }
    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(document)})
    out.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(
        table, out, row_group_size=ROW_GROUP_ROWS, compression="zstd", compression_level=1
    )
