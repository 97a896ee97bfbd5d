"""What varied beside the machines, as temperature or load: read from a CSV file."""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError

Array = NDArray[np.float64]

MOST_GAP_S = 24 * 3600.0
"""How far a reading may be from a point that it is taken for [s]. Longer takes yesterday's weather
for today's, shorter leaves series without their covariates. Chosen by hand: a day."""
MOST_MISSING = 0.25
"""Part of a series' points that may have no reading of a covariate for it to be used; they are left
out. Larger blinds a series for longer, smaller judges more of them as they are. Chosen by hand."""
NEWEST = 3
"""Of so many newest points one must have a reading: what changed since then is not left out. As
many as a change must last."""
MACHINE, TIME = "machine", "time"
EVERY = ""
"""Stands where a reading is of every machine."""


@dataclass(frozen=True)
class Readings:
    """Of one covariate at one machine, in order of time."""

    time_s: Array
    value: Array


@dataclass(frozen=True)
class Covariates:
    """Readings of each covariate, by machine; those of `EVERY` hold where a machine has none."""

    names: tuple[str, ...] = ()
    readings: Mapping[tuple[str, str], Readings] = field(default_factory=dict)
    """By machine and name."""

    def usual(self) -> Array:
        """Return each covariate's median over all readings, (m,)."""
        told: list[float] = []
        for name in self.names:
            own = [each.value for (_, other), each in self.readings.items() if other == name]
            told.append(float(np.median(np.concatenate(own))))
        return np.array(told)

    def beside(self, machine: str, time_s: Array) -> Array:
        """Return the values of all covariates at the points of a series.

        Parameters
        ----------
        machine
            Whose series it is.
        time_s
            Of its points, since 1970, (N,).

        Returns
        -------
        ndarray
            A column of each of `names`, (N, m): between the readings around each point; NaN where
            one of them is further than a day.
        """
        columns = [np.full(len(time_s), np.nan) for _ in self.names]
        for column, name in zip(columns, self.names, strict=True):
            found = self.readings.get((machine, name)) or self.readings.get((EVERY, name))
            if found is not None:
                column[:] = _at(found, time_s)
        return np.column_stack(columns) if columns else np.empty((len(time_s), 0))


def usable(values: Array) -> NDArray[np.bool_]:
    """Return which covariates are known at enough points of a series to be used, (m,).

    Parameters
    ----------
    values
        Of each covariate, NaN where it is not known, (N, m).
    """
    known = np.isfinite(values)
    if not len(values):
        return np.zeros(values.shape[1], bool)
    enough = np.asarray(np.mean(known, axis=0) >= 1.0 - MOST_MISSING, np.bool_)
    return enough & np.asarray(known[-NEWEST:].any(axis=0), np.bool_)


def read_covariates(file: Path) -> Covariates:
    """Read covariates.

    Parameters
    ----------
    file
        CSV with a heading: `machine` (empty: every machine), `time` (ISO 8601; UTC where it says
        no zone), and a column of numbers for each covariate; an empty cell is no reading.

    Raises
    ------
    DataError
        Where it cannot be read, naming line and column.
    """
    told: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    try:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            rows = csv.reader(lines)
            heading = [name.strip() for name in next(rows, [])]
            names = tuple(name for name in heading if name not in (MACHINE, TIME))
            missing = [name for name in (MACHINE, TIME) if name not in heading]
            if missing or not names or len(set(heading)) < len(heading) or "" in names:
                raise DataError(
                    f"{file}: line 1: its columns are {', '.join(heading) or 'none'}: should be "
                    f"{MACHINE}, {TIME}, and one or more of numbers, as temperature_C, each once"
                )
            for row in rows:
                if not row:
                    continue
                where = f"{file}: line {rows.line_num}"
                if len(row) != len(heading):
                    raise DataError(f"{where}: has {len(row)} cells, its heading {len(heading)}")
                cells = dict(zip(heading, row, strict=True))
                time_s = _moment(where, cells[TIME])
                for name in names:
                    if cells[name].strip():
                        value = _number(where, name, cells[name])
                        told[cells[MACHINE].strip(), name].append((time_s, value))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{file}: cannot be read as CSV: {error}") from error
    used = tuple(name for name in names if any(other == name for _, other in told))
    if not used:
        raise DataError(f"{file}: has no readings")
    return Covariates(used, {key: _sorted(pairs) for key, pairs in told.items()})


def _sorted(pairs: list[tuple[float, float]]) -> Readings:
    time_s, value = np.array(sorted(pairs)).T
    return Readings(time_s, value)


def _at(readings: Readings, time_s: Array) -> Array:
    """Return readings at the points of a series; NaN where one has none near."""
    times, values = readings.time_s, readings.value
    after = np.clip(np.searchsorted(times, time_s), 0, len(times) - 1)
    before = np.where((times[after] > time_s) & (after > 0), after - 1, after)
    far = np.maximum(np.abs(times[after] - time_s), np.abs(time_s - times[before]))
    return np.where(far > MOST_GAP_S, np.nan, np.interp(time_s, times, values))


def _moment(where: str, told: str) -> float:
    try:
        moment = datetime.fromisoformat(told.strip())
    except ValueError:
        raise DataError(
            f"{where}: {TIME} is {told!r}: should be a date and time, as 2026-03-01T06:00:00+00:00"
        ) from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _number(where: str, name: str, told: str) -> float:
    try:
        value = float(told)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(f"{where}: {name} is {told!r}: should be a number, or empty")
    return value
