"""What a page shows in one column: where its rows stand in time, and what it is at this moment."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log.sample import AxisState
from motorctl.scope.estimate_bounds import estimate_bounds
from motorctl.scope.pyramid import Pyramid, Recorded

GAP_PERIODS = 1.5
"""Rows further apart than so many periods are drawn apart. Skipped ticks are whole periods, so
anything between 1 and 2 tells them."""
LONGEST_NAME = 80


class Shown:
    """A log, or a running machine, that the page looks at.

    Its methods may be called by several threads, which hold `lock` meanwhile.
    """

    log: Recorded
    pyramid: Pyramid
    name: str
    live = False
    """Whether it is a machine that runs now."""

    def __init__(self) -> None:
        self.lock = threading.RLock()

    def refresh(self) -> None:
        """Look whether there is more than before."""

    @property
    def unfinished(self) -> bool:
        """Whether it may grow."""
        return False

    def _take(self, log: Recorded) -> None:
        """Show these rows from now on."""
        self.log = log
        self.pyramid = Pyramid(log)
        self.changes: dict[tuple[str, int], tuple[NDArray[np.int64], NDArray[np.int64]]] = {}
        """Of an axis in a piece, the rows at which its state changes, and what to."""
        self.missed: dict[tuple[str, int], tuple[NDArray[np.int64], NDArray[np.int64]]] = {}
        """Of an axis in a piece, from which rows to before which it had no new sample."""
        self._program_begins_s: float | None = None
        self._begins_s = self._piece_times()

    def rate_hz(self) -> float:
        """Return the rows a second."""
        return self.log.sample_rate_hz

    def begin_s(self) -> float:
        """Return the time of the first row [s]."""
        return float(self._begins_s[0])

    def end_s(self) -> float:
        """Return the time of the last row [s]."""
        return self.time_of(self.log.rows - 1)

    def program_begins_s(self) -> float:
        """Return when the first axis begins to run [s]; the first row's time where none does."""
        if self._program_begins_s is None:
            found = [self._first_running(axis) for axis in self.log.axes]
            times = [self.time_of(row) for row in found if row is not None]
            self._program_begins_s = min(times, default=self.begin_s())
        return self._program_begins_s

    def rows_between(self, begin_s: float, end_s: float) -> tuple[int, int]:
        """Return the rows of a stretch of time, and one beyond each end: lines reach the edges."""
        first = max(self.row_at(begin_s) - 1, 0)
        return first, min(self.row_at(end_s) + 1, self.log.rows)

    def row_at(self, time_s: float) -> int:
        """Return the first row that is not before this time."""
        piece = int(np.searchsorted(self._begins_s, time_s, side="right")) - 1
        if piece < 0:
            return 0
        times = self.pyramid.piece("time_s", piece)
        return int(self.pyramid.begins[piece]) + int(np.searchsorted(times, time_s))

    def time_of(self, row: int) -> float:
        """Return the time of an existing row [s]."""
        (piece,) = self.pyramid.pieces(row, row + 1)
        if row == self.pyramid.begins[piece]:
            return float(self._begins_s[piece])
        times = self.pyramid.piece("time_s", piece)
        return float(times[row - int(self.pyramid.begins[piece])])

    def values_at(self, time_s: float) -> Mapping[str, float | None]:
        """Return every column in the row nearest to a time, None for what is no number."""
        row = min(self.row_at(time_s), self.log.rows - 1)
        if row and time_s - self.time_of(row - 1) < self.time_of(row) - time_s:
            row -= 1
        told = {}
        for name in self.log.columns:
            value = float(self.pyramid.rows(name, row, row + 1)[0])
            told[name] = value if np.isfinite(value) else None
        return told

    def _piece_times(self) -> NDArray[np.float64]:
        known = self.pyramid.extremes("time_s").low
        if np.isfinite(known).all():
            return known
        first = [self.pyramid.piece("time_s", k)[0] for k in range(len(known))]
        return np.array(first, float)

    def _first_running(self, axis: str) -> int | None:
        """Return the row in which an axis first runs; None where none tells so."""
        name = f"{axis}.state"
        if name not in self.log.columns:
            return None
        known = self.pyramid.extremes(name)
        for k in range(len(known.begins)):
            if known.high[k] < AxisState.RUNNING or known.low[k] > AxisState.RUNNING:
                continue
            running = np.flatnonzero(self.pyramid.piece(name, k) == AxisState.RUNNING)
            if len(running):
                return int(known.begins[k]) + int(running[0])
        return None

    def told(self) -> dict[str, Any]:
        """Return what the page is told of the log, for JSON."""
        log, metadata = self.log, self.log.metadata
        config = metadata.get("config")
        config = config if isinstance(config, dict) else {}
        return {
            "name": self.name[-LONGEST_NAME:],
            "live": self.live,
            "rows": log.rows,
            "rate_hz": self.rate_hz(),
            "begin_s": self.begin_s(),
            "end_s": self.end_s(),
            "program_begins_s": self.program_begins_s(),
            "unfinished": self.unfinished,
            "machine": metadata.get("machine"),
            "controllers": {
                name: axis.get("controller")
                for name, axis in _mapping(config.get("axes")).items()
                if isinstance(axis, dict)
            },
            "paths": paths(
                config, {name: log.units.get(f"{name}.position_m", "") for name in log.axes}
            ),
            "axes": list(log.axes),
            "units": {name: log.units.get(name, "") for name in log.columns},
            "bounds": {
                name: bounds
                for name, bounds in estimate_bounds(config).items()
                if name in log.columns
            },
            "notes": list(log.notes),
        }


def paths(config: Mapping[str, Any], units: Mapping[str, str]) -> list[list[str]]:
    """Return the pairs of axes to draw one over the other, those that belong together first.

    Parameters
    ----------
    config
        The log's: pairs that a program of it leads together come first.
    units
        Of the positions, by axis: pairs of one unit come before others, which have no distance in
        common.
    """
    pairs = []
    for program in _mapping(config.get("programs")).values():
        led = program.get("axes") if isinstance(program, dict) else None
        if isinstance(led, list) and len(led) > 1 and all(name in units for name in led[:2]):
            pairs.append(led[:2])
    others = [list(pair) for pair in combinations(units, 2)]
    pairs += sorted(others, key=lambda pair: units[pair[0]] != units[pair[1]])
    return [pair for k, pair in enumerate(pairs) if sorted(pair) not in map(sorted, pairs[:k])]


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}
