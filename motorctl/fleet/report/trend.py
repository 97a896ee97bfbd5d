"""The picture of a series as paths of SVG: small enough for hundreds, sharp on any screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.fleet.change import Change
from motorctl.fleet.changes import Judged
from motorctl.fleet.series import BIN_S

Array = NDArray[np.float64]

WIDTH, HEIGHT = 1000, 240
"""Of a large picture in its own units; the page stretches it."""
SMALL_WIDTH, SMALL_HEIGHT = 300, 40
ERRORS = 2.0
"""Standard errors that the band about a level shows."""
MARGIN = 0.06


@dataclass(frozen=True)
class Trend:
    """A large picture."""

    points: str
    plain: str
    """The points as they are, where covariates were taken from those above; else empty."""
    siblings: str
    """The median of its siblings, moved to its own level before the change; else empty."""
    lines: str
    bands: tuple[str, ...]
    change_x: float
    low: float
    high: float
    others: int


def small(value: Array, time_s: Array) -> str:
    """Return a series as one line."""
    low, high = float(np.min(value)), float(np.max(value))
    x = _scaled(time_s, time_s[0], time_s[-1], SMALL_WIDTH)
    y = SMALL_HEIGHT - _scaled(value, low, high, SMALL_HEIGHT)
    return _line(x, y)


def trend_of(judged: Judged, change: Change, beside: Sequence[Judged], *, plain: bool) -> Trend:
    """Draw a series with its change.

    Parameters
    ----------
    judged
        The series.
    change
        Which of it is shown.
    beside
        All of the fleet, among which its siblings are.
    plain
        Whether the change is of the series as it is, and not beside its covariates.
    """
    series, influence = judged.series, judged.influence
    time_s = series.time_s
    raw = None if plain or influence is None else series.value
    value = series.value if raw is None or influence is None else influence.adjusted
    siblings, others = _siblings(judged, change, beside)
    everything = [value, *([] if raw is None else [raw])]
    low = min(float(np.min(each)) for each in everything)
    high = max(float(np.max(each)) for each in everything)
    if len(siblings[0]):
        low, high = min(low, float(np.min(siblings[1]))), max(high, float(np.max(siblings[1])))
    low, high = low - MARGIN * (high - low), high + MARGIN * (high - low)

    def x(at: Array) -> Array:
        return _scaled(at, time_s[0], time_s[-1], WIDTH)

    def y(at: Array) -> Array:
        return HEIGHT - _scaled(at, low, high, HEIGHT)

    parts = _parts(change, time_s)
    bands, lines = [], []
    for times, values, errors in parts:
        upper, lower = values + ERRORS * errors, values - ERRORS * errors
        lines.append(_line(x(times), y(values)))
        around = np.concatenate([times, times[::-1]])
        bands.append(_line(x(around), y(np.concatenate([upper, lower[::-1]]))) + "z")
    return Trend(
        _dots(x(time_s), y(value)),
        "" if raw is None else _dots(x(time_s), y(raw)),
        _line(x(siblings[0]), y(siblings[1])) if len(siblings[0]) else "",
        "".join(lines),
        tuple(bands),
        float(x(np.array([_moment(change, time_s)]))[0]) / WIDTH,
        low,
        high,
        others,
    )


def _moment(change: Change, time_s: Array) -> float:
    """Return when it changed: between the points around a step, at the beginning of a drift."""
    if change.form == "drift":
        return float(time_s[change.first])
    return float(time_s[change.first - 1] + time_s[change.first]) / 2.0


def _parts(change: Change, time_s: Array) -> list[tuple[Array, Array, Array]]:
    """Return times, values and errors of the lines that the change says."""
    at = _moment(change, time_s)
    before, after = change.before, change.after
    begins = time_s[max(0, change.first - before.points)] if change.form == "step" else time_s[0]
    level = (
        np.array([begins, at]),
        np.full(2, before.value),
        np.full(2, before.std_error),
    )
    if change.form == "drift":
        rise = (
            np.array([at, time_s[-1]]),
            np.array([before.value, after.value]),
            np.array([before.std_error, after.std_error]),
        )
        return [level, rise] if change.first else [rise]
    last = time_s[min(len(time_s), change.first + after.points) - 1]
    return [level, (np.array([at, last]), np.full(2, after.value), np.full(2, after.std_error))]


def _siblings(
    judged: Judged, change: Change, beside: Sequence[Judged]
) -> tuple[tuple[Array, Array], int]:
    own = judged.series
    same = [
        each.series
        for each in beside
        if each.series.machine != own.machine
        and (each.series.axis, each.series.program, each.series.name, each.series.unit)
        == (own.axis, own.program, own.name, own.unit)
    ]
    nothing = (np.empty(0), np.empty(0)), 0
    if judged.standing is None:
        return nothing
    places = np.floor(own.time_s / BIN_S)
    columns = []
    for each in same:
        where = {place: k for k, place in enumerate(np.floor(each.time_s / BIN_S))}
        column = np.array([each.value[where[p]] if p in where else np.nan for p in places])
        columns.append(column - np.median(each.value))
    all_of = np.column_stack(columns)
    known = np.isfinite(all_of).sum(axis=1) >= len(same) / 2
    if not known[: max(change.first, 1)].any():
        return nothing
    middle = np.full(len(places), np.nan)
    middle[known] = np.nanmedian(all_of[known], axis=1)
    middle += change.before.value - float(np.nanmedian(middle[: max(change.first, 1)]))
    return (own.time_s[known], middle[known]), len(same)


def _scaled(value: Array, low: float, high: float, size: int) -> Array:
    spread = high - low
    if not spread:
        return np.full(len(value), size / 2.0)
    return np.clip((value - low) / spread, 0.0, 1.0) * size


def _line(x: Array, y: Array) -> str:
    pairs = zip(np.round(x).astype(int), np.round(y).astype(int), strict=True)
    return "M" + " ".join(f"{a} {b}" for a, b in pairs)


def _dots(x: Array, y: Array) -> str:
    pairs = zip(np.round(x).astype(int), np.round(y).astype(int), strict=True)
    return "".join(f"M{a} {b}h0" for a, b in pairs)
