"""Single damaged values in a column of positions: far from where the axis was before and after."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from motorctl.log.table import Array, Table

MOST_WILD = 10
"""Values of a column that may be damaged one by one. Larger takes time, and takes what comes often
for damage; smaller leaves some in. Chosen by hand."""
FAR = 10.0
"""How far such a value lies off the line between its neighbours, over the largest such distance in
the rest of the column. Larger leaves damaged values in, smaller takes the machine's own impacts for
damage. Chosen by hand."""
TURNS_BACK = 0.3
"""What its neighbours lie off at least, the other way, over what it does itself: half of it, where
nothing else happens. Larger misses damage in quick motion, smaller takes an impact, which leaves
its neighbours on their lines, for it. Chosen by hand."""
FEWEST_FAILED, MOST_FAILED = 3, 0.01
"""In how many places one and the same value stands at least, and in what part of a column's rows at
most, to be what failed reads leave. Fewer are judged one by one; a larger part leaves too little,
a smaller one leaves them in. Chosen by hand: an arm's bus failed in one row of 850."""
MOST_IN_A_ROW = 2
"""Rows of one value behind each other that may be failed reads where they are in one place or two.
Larger takes a knock against something for them, smaller leaves pairs in. Chosen by hand."""
_FEWEST = 32
_TOLD = 3


def without_wild(
    table: Table, name: str, values: Array, *, is_speed: bool = False
) -> tuple[Array, list[str]]:
    """Return a column of a motion with damaged values as NaN, and notes that tell each.

    A speed may be the same several times, and zero else: such values are judged one by one.
    """
    rows = np.flatnonzero(np.isfinite(values))
    wild = rows[wild_places(values[rows], failed_reads=not is_speed)]
    if not wild.size:
        return values, []
    out = values.copy()
    out[wild] = np.nan
    told = "; ".join(_told(table, name, values, rows, int(k)) for k in wild[:_TOLD])
    more = f"; and {wild.size - _TOLD} more" if wild.size > _TOLD else ""
    return out, [
        f"column '{name}' has {wild.size} damaged value{'s' if wild.size > 1 else ''}, left out of "
        f"every judgement: {told}{more}"
    ]


def wild_places(x: Array, *, failed_reads: bool = True) -> NDArray[np.intp]:
    """Return where single values of a column lie far off, (m,) in rising order; x is finite, (N,).

    A value is judged by its distance from the middle of its neighbours, the first and the last one
    by the step to their only neighbour.
    """
    if len(x) < _FEWEST:
        return np.zeros(0, dtype=np.intp)
    failed = _failed_reads(x) if failed_reads else np.zeros(0, dtype=np.intp)
    if failed.size:
        kept = np.delete(np.arange(len(x)), failed)
        return np.sort(np.concatenate([failed, kept[wild_places(x[kept])]]))
    x = x.copy()
    found: list[int] = []
    sure = 0
    smallest = np.inf
    for place, size in _furthest(x):
        if size * FAR < smallest and size > 0.0 and found:
            sure = len(found)
        if place is None or len(found) == MOST_WILD:
            break
        found.append(place)
        smallest = min(smallest, size)
    return np.array(sorted(found[:sure]), dtype=np.intp)


def _failed_reads(x: Array) -> NDArray[np.intp]:
    """Return where one and the same value stands far off the line between what is beside it."""
    none = np.zeros(0, dtype=np.intp)
    off = np.abs(x[1:-1] - 0.5 * (x[:-2] + x[2:]))
    k = int(np.argmax(off))
    for value in dict.fromkeys(x[k : k + 3]):
        places = np.flatnonzero(x == value)
        spells = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
        inside = places[0] > 0 and places[-1] < len(x) - 1
        short = inside and len(places) > 1 and max(map(len, spells)) <= MOST_IN_A_ROW
        single = sum(len(spell) == 1 for spell in spells)
        often = len(spells) >= FEWEST_FAILED and 2 * single >= len(spells)
        if not (short or often) or len(places) > MOST_FAILED * len(x):
            continue
        rest = np.delete(x, places)
        line = np.interp(places, np.delete(np.arange(len(x)), places), rest)
        usual = float(np.max(np.abs(rest[1:-1] - 0.5 * (rest[:-2] + rest[2:]))))
        if 0.0 < FAR * usual < float(np.min(np.abs(value - line))):
            return places
    return none


def _furthest(x: Array) -> Iterator[tuple[int | None, float]]:
    """Yield the place of each value that may be damaged, furthest first, and mend it in `x`.

    The last is None, and how far off the rest is.
    """
    while True:
        off = x[1:-1] - 0.5 * (x[:-2] + x[2:])
        k = int(np.argmax(np.abs(off)))
        size = float(abs(off[k]))
        beside = [-off[j] / off[k] for j in (k - 1, k + 1) if size and 0 <= j < len(off)]
        if beside and min(beside) > TURNS_BACK:
            yield k + 1, size
            x[k + 1] -= off[k]
        elif (end := _wild_end(x, k)) is not None:
            yield end, size
            x[end] = x[end + 1 if end == 0 else end - 1]
        else:
            yield None, size
            return


def _wild_end(x: Array, k: int) -> int | None:
    """Return the first or last place where the step to it is none of the column's, else None."""
    steps = np.abs(np.diff(x))
    if k == 0 and steps[0] > FAR * steps[1:].max():
        return 0
    if k == len(x) - 3 and steps[-1] > FAR * steps[:-1].max():
        return len(x) - 1
    return None


def _told(table: Table, name: str, values: Array, rows: NDArray[np.intp], wild: int) -> str:
    """Say where a damaged value stands, and what stands beside it."""
    place = int(np.searchsorted(rows, wild))
    before = f"{values[rows[place - 1]]:.6g} before" if place else ""
    behind = f"{values[rows[place + 1]]:.6g} behind" if place + 1 < len(rows) else ""
    beside = " and ".join(filter(None, (before, behind)))
    return f"{table.row(wild, name)} is {values[wild]:.6g}, with {beside}"
