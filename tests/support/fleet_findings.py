"""A store of findings made up from numbers, without any log: many machines and days at once.

python tests/support/fleet_findings.py FOLDER     # 50 machines, 60 days, 3 logs a day
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from motorctl.fleet.findings import table_of_log
from motorctl.fleet.head import LogHead
from motorctl.fleet.store import Store, open_store

BEGAN = datetime(2026, 3, 1, tzinfo=UTC)
FRICTION = "coulomb_friction"
PARAMETERS = {
    "inertia": (0.43, 0.001, "V*s^2/m"),
    "viscous_friction": (0.56, 0.004, "V*s/m"),
    FRICTION: (0.14, 0.003, "V"),
    "offset": (0.02, 0.002, "V"),
    "em_quadratic": (1.1e-3, 2e-5, "V/V^2"),
    "em_cubic": (4e-4, 1e-5, "V/V^3"),
    "input_delay_s": (2e-4, 2e-6, "s"),
    "residual_rms": (0.018, 5e-4, "V"),
}
"""Usual value, scatter and unit of each."""
Moved = Callable[[str, str, str, float], float]
"""By how many times its scatter a parameter is away: of machine, axis, parameter and day."""


def head(machine: str, log_id: str, begin: datetime, model_id: str = "model") -> LogHead:
    return LogHead(
        source=f"{machine}/{log_id}.parquet", log_id=log_id, model_id=model_id, machine=machine,
        limits_id="", copied=False,
        host="computer", run=None, part=None, begin_utc=begin, end_utc=begin, first_s=0.0,
        virtual=False, rate_hz=5000.0, group_rows=(1,), moved={"x": (True,)}, programs={},
    )  # fmt: skip


def parameter(value: float, std_error: float = 0.01, **told: Any) -> dict[str, Any]:
    return {
        "axis": "x", "program": "p", "window": 0, "kind": "parameter", "name": FRICTION,
        "value": value, "std_error": std_error, "unit": "V", **told,
    }  # fmt: skip


def kept(told: LogHead, value: float, std_error: float = 0.01) -> pa.Table:
    return table_of_log(told, f"{told.log_id}-{told.model_id}", [parameter(value, std_error)])


def keep(store: Store, name: str, logs: Iterable[pa.Table]) -> None:
    """Write what many logs tell into one file, as writing hundreds takes seconds."""
    store.write(name, BEGAN, pa.concat_tables(logs))


def fleet_store(
    folder: Path,
    *,
    machines: Sequence[str],
    days: int,
    logs_a_day: int = 3,
    axes: Sequence[str] = ("x",),
    names: Sequence[str] = (FRICTION,),
    moved: Moved = lambda machine, axis, name, day: 0.0,
    one_file: bool = True,
    seed: int = 0,
) -> Store:
    """Write a store of machines whose parameters scatter, each about a level of its own."""
    store, rng = open_store(folder, create=True), np.random.default_rng(seed)
    tables = []
    for machine in machines:
        own = {(axis, name): rng.standard_normal() for axis in axes for name in names}
        for k in range(days * logs_a_day):
            day = k / logs_a_day
            begin = BEGAN + timedelta(days=day)
            told = head(machine, hashlib.sha256(f"{machine} {k}".encode()).hexdigest(), begin)
            span = {"begin_utc": begin, "end_utc": begin + timedelta(seconds=20),
                    "begin_s": 2.0, "end_s": 22.0, "rows": 100_000}  # fmt: skip
            rows = []
            for axis in axes:
                for name in names:
                    usual, scatter, unit = PARAMETERS[name]
                    away = own[axis, name] + moved(machine, axis, name, day)
                    value = usual + scatter * (away + rng.standard_normal())
                    rows.append(parameter(value, scatter / 3.0, axis=axis, name=name, unit=unit))
                rows.append({"axis": axis, "program": "p", "window": 0, "kind": "verdict",
                             "name": "complete", "text": "nothing beyond noise"})  # fmt: skip
            table = table_of_log(told, told.log_id[:32], [row | span for row in rows])
            if one_file:
                tables.append(table)
            else:
                store.write(told.log_id[:32], begin, table)
    if tables:
        keep(store, "all", tables)
    return store


def changed(machine: str, axis: str, name: str, day: float) -> float:
    """Move some parameters of a large fleet: steps, drifts, and one machine that was always odd."""
    steps = {("m07", "x", FRICTION): (50.0, 9.0), ("m23", "y", "inertia"): (30.0, -12.0),
             ("m31", "x", "input_delay_s"): (58.0, 20.0)}  # fmt: skip
    drifts = {("m12", "y", "viscous_friction"): 25.0, ("m40", "x", "residual_rms"): 9.0}
    where = (machine, axis, name)
    if where in steps:
        return steps[where][1] * (day >= steps[where][0])
    if where in drifts:
        return drifts[where] * day / 60.0
    return 15.0 if where == ("m05", "y", "offset") else 0.0


if __name__ == "__main__":
    fleet_store(
        Path(sys.argv[1]),
        machines=[f"m{k:02d}" for k in range(50)],
        days=60,
        axes=("x", "y"),
        names=tuple(PARAMETERS),
        moved=changed,
        one_file=False,
    )
