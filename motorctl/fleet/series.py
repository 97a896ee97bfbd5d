"""How a parameter went over days: one value every eight hours, from the findings of a store."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
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
KEY = ("machine", "axis", "program", "name", "unit")
"""Columns that no two series have alike."""
COLUMNS = (
    *("log_id", "model_id", *KEY),
    *("value", "std_error", "begin_utc", "source", "written_utc", "begin_s", "end_s"),
)


@dataclass(frozen=True, slots=True)
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
    return series_from(newest_rows(store, list(COLUMNS), ds.field("kind") == "parameter"))


def newest_rows(
    store: Store, columns: list[str] | None = None, where: ds.Expression | None = None
) -> pa.Table:
    """Return findings, of a log that was looked at more than once the newest, in order of time.

    The newest of all: of a log that was refused later none is left, whatever `where` asks for.
    Raises DataError where the store is damaged.
    """
    looked = store.read(["log_id", "written_utc"]).group_by("log_id")
    last = looked.aggregate([("written_utc", "max")])
    rows = store.read(columns, where)
    place = pc.index_in(rows.column("log_id"), value_set=last.column("log_id").combine_chunks())
    newest = pc.equal(rows.column("written_utc"), last.column("written_utc_max").take(place))
    rows = rows.filter(newest)
    undated = pa.scalar(0, pa.int64()).cast(rows.schema.field("begin_utc").type)
    order = pa.Table.from_arrays(
        [rows.column("begin_utc").fill_null(undated), rows.column("log_id")], ["begin", "log"]
    )
    return rows.take(pc.sort_indices(order, [("begin", "ascending"), ("log", "ascending")]))


def series_from(rows: pa.Table) -> list[Series]:
    """Return the series of the parameters among findings that are in order of time.

    Of an axis the values of the model that was fitted last count: those of different models cannot
    be compared.
    """
    if not rows.num_rows:
        return []
    counted = rows.filter(_of_last_model(rows))
    keys, found = _groups(counted, KEY)
    all_keys, every = _groups(rows, KEY)
    counts = {key: len(at) for key, at in zip(all_keys, every, strict=True)}
    columns = _Columns.of(counted)
    return [
        _binned(key, at, columns, counts[key] - len(at))
        for key, at in sorted(zip(keys, found, strict=True), key=lambda each: each[0])
    ]


def _codes(column: pa.ChunkedArray[Any]) -> tuple[NDArray[np.intp], list[Any]]:
    """Return each value of a column as a place among its different values, and these."""
    encoded = column.combine_chunks().dictionary_encode(null_encoding="encode")
    return encoded.indices.to_numpy().astype(np.intp), encoded.dictionary.to_pylist()


def _groups(
    rows: pa.Table, names: Sequence[str]
) -> tuple[list[tuple[Any, ...]], list[NDArray[np.intp]]]:
    """Return what some columns hold together, and the places of each of these, in order."""
    codes, values = zip(*(_codes(rows.column(name)) for name in names), strict=True)
    different, place = np.unique(np.column_stack(codes), axis=0, return_inverse=True)
    place = place.reshape(-1)
    order = np.argsort(place, kind="stable")
    ends = np.cumsum(np.bincount(place, minlength=len(different)))
    keys = [
        tuple(value[k] for value, k in zip(values, codes_of, strict=True))
        for codes_of in different.tolist()
    ]
    return keys, np.split(order, ends[:-1])


def _of_last_model(rows: pa.Table) -> pa.Array[Any]:
    """Return which rows are of the model that was fitted last to their axis."""
    written = rows.column("written_utc").cast(pa.int64()).to_numpy()
    model = _codes(rows.column("model_id"))[0]
    wanted = np.zeros(rows.num_rows, np.bool_)
    for at in _groups(rows, ("machine", "axis"))[1]:
        last = at[np.argsort(written[at], kind="stable")[-1]]
        wanted[at] = model[at] == model[last]
    return pa.array(wanted)


@dataclass(frozen=True)
class _Columns:
    """Of N rows what makes points; what many rows share is held once."""

    value: Array
    std_error: Array
    begin: Array
    """Since 1970 [s]."""
    begin_s: Array
    end_s: Array
    source: NDArray[np.intp]
    sources: list[str]
    log: NDArray[np.intp]
    logs: list[str]

    @classmethod
    def of(cls, rows: pa.Table) -> _Columns:
        def numbers(name: str) -> Array:
            return np.asarray(rows.column(name).to_numpy(), np.float64)

        since_1970 = rows.column("begin_utc").cast(pa.timestamp("us", "UTC")).cast(pa.int64())
        return cls(
            numbers("value"),
            numbers("std_error"),
            since_1970.to_numpy() / 1e6,
            numbers("begin_s"),
            numbers("end_s"),
            *_codes(rows.column("source")),
            *_codes(rows.column("log_id")),
        )

    def seen(self, row: int) -> Seen:
        """Return the window that a row is of."""
        span = (float(self.begin_s[row]), float(self.end_s[row]))
        begin_s, end_s = (None if math.isnan(each) else each for each in span)
        return Seen(self.sources[self.source[row]], self.logs[self.log[row]], begin_s, end_s)


def _binned(key: tuple[str, ...], rows: NDArray[np.intp], columns: _Columns, others: int) -> Series:
    value, error, begin = columns.value[rows], columns.std_error[rows], columns.begin[rows]
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
        seen=tuple(columns.seen(int(rows[_typical(value, at)])) for at in points),
        of_other_models=others,
    )


def _typical(value: Array, at: NDArray[np.intp]) -> int:
    """Return the place whose value is nearest to the median: where a step is, it is after it."""
    return int(at[np.argmin(np.abs(value[at] - np.median(value[at])))])
