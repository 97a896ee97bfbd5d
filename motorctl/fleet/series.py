"""How a parameter went over days: one value every eight hours, from the findings of a store."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pyarrow.dataset as ds
from numpy.typing import NDArray

from motorctl.fleet.store import Store

Array = NDArray[np.float64]

BIN_S = 8 * 3600.0
"""Findings within so long become one point [s], their median: windows that follow each other share
temperature and load, and are no independent witnesses. Longer tells a change later, shorter takes
a shift's weather for one. Chosen by hand: a shift."""
VAGUE = 5.0
"""A value whose standard error is so many times the usual one of its parameter is left out. Larger
lets motions that tell nothing blur the series, smaller loses points. Chosen by hand."""
_UNDATED = datetime.min.replace(tzinfo=UTC)
_COLUMNS = (
    *("log_id", "model_id", "machine", "axis", "program", "name"),
    *("value", "std_error", "unit", "begin_utc", "source", "written_utc", "begin_s", "end_s"),
)


@dataclass(frozen=True)
class Seen:
    """Where a value was seen: a window of a log."""

    source: str
    log_id: str
    begin_s: float | None = None
    """By the log's own time; None: all of it."""
    end_s: float | None = None


@dataclass(frozen=True)
class Series:
    """One parameter of one axis under one program; N points in order of time."""

    machine: str
    axis: str
    program: str
    name: str
    unit: str
    time_s: Array
    """Since 1970, of the middle of what each point stands for, (N,)."""
    value: Array
    """(N,)"""
    seen: tuple[Seen, ...]
    """A window of each point, as near to its value as any."""
    of_other_models: int = 0
    """Values that were left out because another model gave them."""

    def moment(self, point: int) -> datetime:
        """Return when a point was."""
        return datetime.fromtimestamp(float(self.time_s[point]), UTC)

    @property
    def key(self) -> tuple[str, ...]:
        """Return what no other series has."""
        return (self.machine, self.axis, self.program, self.name, self.unit)

    def only(self, wanted: NDArray[np.bool_]) -> Series:
        """Return some points of it.

        Parameters
        ----------
        wanted
            Which, (N,).
        """
        if wanted.all():
            return self
        seen = tuple(each for each, kept in zip(self.seen, wanted, strict=True) if kept)
        return replace(self, time_s=self.time_s[wanted], value=self.value[wanted], seen=seen)


def seen_in(row: Mapping[str, Any]) -> Seen:
    """Return the window that a row of the store is of."""
    return Seen(str(row["source"]), str(row["log_id"]), row["begin_s"], row["end_s"])


def series_of(store: Store) -> list[Series]:
    """Return the series of every parameter in a store, in order of their names.

    Raises DataError where the store is damaged.
    """
    return series_from(newest_rows(store, list(_COLUMNS), ds.field("kind") == "parameter"))


def newest_rows(
    store: Store, columns: list[str] | None = None, where: ds.Expression | None = None
) -> list[dict[str, Any]]:
    """Return findings, of a log that was looked at more than once the newest, in order of time.

    The newest of all: of a log that was refused later none is left, whatever `where` asks for.
    Raises DataError where the store is damaged.
    """
    looked = store.read(["log_id", "written_utc"]).group_by("log_id")
    last = looked.aggregate([("written_utc", "max")])
    names = (last.column(name).to_pylist() for name in ("log_id", "written_utc_max"))
    newest: dict[str, datetime] = dict(zip(*names, strict=True))
    rows: list[dict[str, Any]] = store.read(columns, where).to_pylist()
    rows = [row for row in rows if row["written_utc"] == newest[row["log_id"]]]
    rows.sort(key=lambda row: (row["begin_utc"] or _UNDATED, row["log_id"]))
    return rows


def series_from(rows: Sequence[Mapping[str, Any]]) -> list[Series]:
    """Return the series of the parameters among findings that are in order of time.

    Of an axis the values of the model that was fitted last count: those of different models cannot
    be compared.
    """
    in_writing = sorted(rows, key=lambda row: row["written_utc"])
    model = {(row["machine"], row["axis"]): row["model_id"] for row in in_writing}
    told: dict[tuple[str, ...], list[Mapping[str, Any]]] = defaultdict(list)
    others: dict[tuple[str, ...], int] = defaultdict(int)
    for row in rows:
        key = tuple(row[k] for k in ("machine", "axis", "program", "name", "unit"))
        if row["model_id"] == model[row["machine"], row["axis"]]:
            told[key].append(row)
        else:
            others[key] += 1
    return [_binned(key, found, others[key]) for key, found in sorted(told.items())]


def _binned(key: tuple[str, ...], rows: Sequence[Mapping[str, Any]], others: int) -> Series:
    value, error = (
        np.array([row[name] for row in rows], np.float64) for name in ("value", "std_error")
    )
    begin = np.array([row["begin_utc"].timestamp() for row in rows])
    good = np.isfinite(value)
    known = error[np.isfinite(error) & (error > 0.0)]
    if len(known):
        good &= ~(error > VAGUE * np.median(known))
    places = np.floor(begin / BIN_S)
    points = [np.flatnonzero(good & (places == place)) for place in np.unique(places[good])]
    machine, axis, program, name, unit = key
    return Series(
        machine,
        axis,
        program,
        name,
        unit,
        time_s=np.array([np.mean(begin[at]) for at in points]),
        value=np.array([np.median(value[at]) for at in points]),
        seen=tuple(seen_in(rows[_typical(value, at)]) for at in points),
        of_other_models=others,
    )


def _typical(value: Array, at: NDArray[np.intp]) -> int:
    """Return the place whose value is nearest to the median: where a step is, it is after it."""
    return int(at[np.argmin(np.abs(value[at] - np.median(value[at])))])
