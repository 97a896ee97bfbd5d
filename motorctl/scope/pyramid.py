"""Least and greatest value a pixel of any stretch of a log, without reading more than is needed.

Three levels: the file's own extremes of each row group, those of each bucket of rows of the row
groups that were read once, and the rows themselves.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motorctl.api.log import Extremes

Array = NDArray[Any]
BUCKET_ROWS = 256
"""Rows of a bucket. Fewer take more memory: 16 bytes a bucket and column, 11 MB for ten hours at
5 kHz; with more, rows are read for longer stretches. By hand."""
MOST_PIECES_HELD = 256
"""Row groups whose rows are kept, of all columns together. Each has 0.5 MB; fewer are read again
while one pans. By hand."""
PATIENCE_S = 0.4
"""How long row groups are read for one answer [s]; the others are told as the file knows them, and
the page asks again. Longer shows a long log later, shorter in more steps. By hand."""


@dataclass(frozen=True)
class Envelope:
    """Columns over a stretch of rows, shape (N,) each."""

    low: Mapping[str, Array]
    high: Mapping[str, Array]
    """The same arrays as `low` where every row is told."""
    every_row: bool
    coarse: bool
    """Whether something is told by row groups that were not read yet: ask again."""


class Recorded(Protocol):
    """What a picture is made of: a log, or what was heard of a machine."""

    units: Mapping[str, str]
    metadata: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def rows(self) -> int:
        """N."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes."""

    @property
    def sample_rate_hz(self) -> float:
        """Rows a second."""

    def part(self, name: str, first: int, last: int) -> Array:
        """Return the rows from `first` to before `last` of a column."""

    def extremes(self, name: str) -> Extremes:
        """Return between what a column lies in each piece."""


class Pyramid:
    """The overview of one log."""

    def __init__(self, log: Recorded) -> None:
        self._log = log
        self._extremes: dict[str, Extremes] = {}
        self._buckets: dict[tuple[str, int], tuple[Array, Array]] = {}
        self._held: OrderedDict[tuple[str, int], Array] = OrderedDict()
        self.begins = log.extremes("time_s").begins
        """First row of each piece, shape (K,)."""

    def extremes(self, name: str) -> Extremes:
        """Return what the file keeps of each piece; NaN where that is nothing."""
        if name not in self._extremes:
            self._extremes[name] = self._log.extremes(name)
        return self._extremes[name]

    def pieces(self, first: int, last: int) -> range:
        """Return the pieces in which these rows stand."""
        from_piece = int(np.searchsorted(self.begins, first, side="right")) - 1
        return range(max(from_piece, 0), int(np.searchsorted(self.begins, last, side="left")))

    def end(self, piece: int) -> int:
        """Return the row behind a piece."""
        return int(self.begins[piece + 1]) if piece + 1 < len(self.begins) else self._log.rows

    def piece(self, name: str, piece: int) -> Array:
        """Return the rows of a piece of a column."""
        key = (name, piece)
        if key in self._held:
            self._held.move_to_end(key)
            return self._held[key]
        values = self._log.part(name, int(self.begins[piece]), self.end(piece))
        self._held[key] = values
        while len(self._held) > MOST_PIECES_HELD:
            self._held.popitem(last=False)
        return values

    def rows(self, name: str, first: int, last: int) -> Array:
        """Return the rows from `first` to before `last` of a column."""
        parts = []
        for k in self.pieces(first, last):
            begin = int(self.begins[k])
            parts.append(self.piece(name, k)[max(first - begin, 0) : last - begin])
        return np.concatenate(parts) if parts else self._log.part(name, 0, 0)

    def envelope(self, names: Sequence[str], first: int, last: int, pixels: int) -> Envelope:
        """Return columns over the rows from `first` to before `last`.

        Parameters
        ----------
        names
            Which columns.
        first, last
            Which rows.
        pixels
            How many least and greatest values are wanted at most; where there are no more than
            twice as many rows, they are told themselves.

        Returns
        -------
        Envelope
            Arrays of one length.
        """
        if last - first <= 2 * pixels:
            rows = {name: self.rows(name, first, last) for name in names}
            return Envelope(rows, rows, every_row=True, coarse=False)
        a_pixel = (last - first) / pixels
        if a_pixel < BUCKET_ROWS:
            starts = np.unique((np.arange(pixels) * a_pixel).astype(np.int64))
            whole = {name: self.rows(name, first, last) for name in names}
            low = {name: np.fmin.reduceat(values, starts) for name, values in whole.items()}
            high = {name: np.fmax.reduceat(values, starts) for name, values in whole.items()}
            return Envelope(low, high, every_row=False, coarse=False)
        return self._overview(names, first, last, a_pixel)

    def _overview(self, names: Sequence[str], first: int, last: int, a_pixel: float) -> Envelope:
        enough = time.monotonic() + PATIENCE_S
        coarse = False
        rows: list[Array] = []
        lows: dict[str, list[Array]] = {name: [] for name in names}
        highs: dict[str, list[Array]] = {name: [] for name in names}
        for k in self.pieces(first, last):
            begin = int(self.begins[k])
            # A piece within a pixel needs no look inside.
            inside = self.end(k) - begin > a_pixel and self._read(names, k, enough)
            known = all(np.isfinite(self.extremes(name).low[k]) for name in names)
            if not inside and not known:
                inside = self._read(names, k, np.inf)
            if inside:
                starts = begin + BUCKET_ROWS * np.arange(len(self._buckets[names[0], k][0]))
                kept = (starts + BUCKET_ROWS > first) & (starts < last)
                rows.append(starts[kept])
                for name in names:
                    low, high = self._buckets[name, k]
                    lows[name].append(low[kept])
                    highs[name].append(high[kept])
                continue
            coarse |= self.end(k) - begin > a_pixel
            rows.append(np.array([begin]))
            for name in names:
                lows[name].append(self.extremes(name).low[k : k + 1])
                highs[name].append(self.extremes(name).high[k : k + 1])
        pixel = ((np.concatenate(rows) - first) / a_pixel).astype(np.int64)
        starts = np.flatnonzero(np.diff(pixel, prepend=np.iinfo(np.int64).min))
        return Envelope(
            {name: np.fmin.reduceat(np.concatenate(lows[name]), starts) for name in names},
            {name: np.fmax.reduceat(np.concatenate(highs[name]), starts) for name in names},
            every_row=False,
            coarse=coarse,
        )

    def _read(self, names: Sequence[str], piece: int, enough: float) -> bool:
        """Return whether the buckets of a piece are there, and read it where there is time."""
        for name in names:
            if (name, piece) not in self._buckets:
                if time.monotonic() > enough:
                    return False
                values = self.piece(name, piece)
                starts = np.arange(0, len(values), BUCKET_ROWS)
                low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
                self._buckets[name, piece] = low, high
        return True
