"""States and faults in words, as a band below the time axis shows them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log.sample import AxisState, FaultCause, SampleFlag, without_sample
from motorctl.scope.pyramid import PATIENCE_S
from motorctl.scope.shown import Shown

MOST_STRETCHES = 400
"""Of an axis' band; more are joined to stretches of changing states. Nobody sees more at once."""
MOST_PIXELS = 2000
"""Row groups narrower than such a part of the view are not read: nobody sees what is in them."""
CHANGING = "changing"


def bands(shown: Shown, begin_s: float, end_s: float) -> dict[str, Any]:
    """Return the states of each axis over a stretch of time, for JSON.

    Parameters
    ----------
    shown
        The log.
    begin_s, end_s
        From when to when [s] by the log's own clock.

    Returns
    -------
    dict
        `axes`: of each axis that tells its state a list of stretches with `from_s`, `to_s`,
        `state` and, where it is in fault, `fault`; `missed`: of each axis that tells it, how many
        `rows` had no new sample, and the `stretches` where they are; `coarse`: whether to ask again
        for more.
    """
    first, last = shown.rows_between(begin_s, end_s)
    told: dict[str, Any] = {"axes": {}, "missed": {}, "coarse": False}
    enough = time.monotonic() + PATIENCE_S
    for axis in shown.log.axes:
        if f"{axis}.flags" in shown.log.columns and last > first:
            missed, coarse = _missed(shown, axis, first, last, enough)
            told["coarse"] |= coarse
            told["missed"][axis] = missed
        if f"{axis}.state" not in shown.log.columns or last <= first:
            continue
        rows, codes, coarse = _changes(shown, axis, first, last, enough)
        told["coarse"] |= coarse
        told["axes"][axis] = _stretches(shown, rows, codes, last)
    return told


def _changes(
    shown: Shown, axis: str, first: int, last: int, enough: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], bool]:
    """Return the rows at which state or cause change, with both as one code; -1: several.

    And whether some row groups were not read yet.
    """
    pyramid = shown.pyramid
    names = [f"{axis}.state", f"{axis}.fault"]
    names = [name for name in names if name in shown.log.columns]
    known = [pyramid.extremes(name) for name in names]
    rows, codes, coarse = [], [], False
    for k in pyramid.pieces(first, last):
        begin, end = int(pyramid.begins[k]), pyramid.end(k)
        told = all(np.isfinite(found.low[k]) for found in known)
        if told and all(found.low[k] == found.high[k] for found in known):
            rows.append(begin)
            codes.append(_code(*(int(found.low[k]) for found in known)))
            continue
        within_a_pixel = end - begin < (last - first) / MOST_PIXELS
        unread = (axis, k) not in shown.changes
        if told and unread and (within_a_pixel or time.monotonic() > enough):
            coarse |= not within_a_pixel
            rows.append(begin)
            tripped = known[0].high[k] == AxisState.FAULT
            codes.append(_code(*(int(found.high[k]) for found in known)) if tripped else -1)
            continue
        if unread:
            code = _code(*(pyramid.piece(name, k).astype(np.int64) for name in names))
            at = np.flatnonzero(np.diff(code, prepend=-2))
            shown.changes[axis, k] = begin + at, code[at]
        found_rows, found_codes = shown.changes[axis, k]
        rows += found_rows.tolist()
        codes += found_codes.tolist()
    all_rows, all_codes = np.array(rows, np.int64), np.array(codes, np.int64)
    current = max(int(np.searchsorted(all_rows, first, side="right")) - 1, 0)
    end = int(np.searchsorted(all_rows, last))
    all_rows, all_codes = all_rows[current:end], all_codes[current:end]
    all_rows[0] = max(all_rows[0], first)
    new = np.flatnonzero(np.diff(all_codes, prepend=-2))
    return all_rows[new], all_codes[new], coarse


def _missed(
    shown: Shown, axis: str, first: int, last: int, enough: float
) -> tuple[dict[str, Any], bool]:
    """Return where an axis had no new sample, and whether some row groups were not read yet.

    Flags of a row group that are all less than HELD have it in none of them.
    """
    known = shown.pyramid.extremes(f"{axis}.flags")
    begins, ends, coarse = [], [], False
    for k in shown.pyramid.pieces(first, last):
        if known.high[k] < SampleFlag.HELD:
            continue
        if (axis, k) not in shown.missed:
            if time.monotonic() > enough and np.isfinite(known.high[k]):
                coarse = True
                continue
            held = without_sample(shown.pyramid.piece(f"{axis}.flags", k)).astype(np.int8)
            edges = np.diff(held, prepend=0, append=0)
            begin = int(shown.pyramid.begins[k])
            shown.missed[axis, k] = (
                begin + np.flatnonzero(edges > 0),
                begin + np.flatnonzero(edges < 0),
            )
        from_rows, to_rows = shown.missed[axis, k]
        begins += from_rows.tolist()
        ends += to_rows.tolist()
    in_view = [(max(a, first), min(b, last)) for a, b in zip(begins, ends, strict=True)]
    in_view = [(a, b) for a, b in in_view if a < b]
    together = max(1, -(-len(in_view) // MOST_STRETCHES))
    stretches = [
        (in_view[k][0], in_view[min(k + together, len(in_view)) - 1][1] - 1)
        for k in range(0, len(in_view), together)
    ]
    told = {
        "rows": sum(b - a for a, b in in_view),
        "stretches": [[shown.time_of(a), shown.time_of(b)] for a, b in stretches],
    }
    return told, coarse


def _code(state: Any, fault: Any = 0) -> Any:
    return state * 256 + fault


def _stretches(
    shown: Shown, rows: NDArray[np.int64], codes: NDArray[np.int64], last: int
) -> list[dict[str, Any]]:
    ends = [*rows[1:].tolist(), last - 1]
    states = _words(shown.log.metadata.get("states"), AxisState)
    faults = _words(shown.log.metadata.get("faults"), FaultCause)
    joined = -(-len(rows) // MOST_STRETCHES)
    told = []
    for k in range(0, len(rows), joined):
        together = codes[k : k + joined]
        trips = together[together >= AxisState.FAULT * 256]
        code = int(trips[0] if len(trips) else together[0] if len(together) == 1 else -1)
        state, fault = divmod(code, 256)
        stretch = {
            "from_s": shown.time_of(int(rows[k])),
            "to_s": shown.time_of(int(ends[min(k + joined, len(rows)) - 1])),
            "state": CHANGING if code < 0 else states.get(state, f"state {state}"),
        }
        if state == AxisState.FAULT:
            stretch["fault"] = faults.get(fault, f"cause {fault}")
        told.append(stretch)
    return told


def _words(named: object, codes: type[AxisState] | type[FaultCause]) -> dict[int, str]:
    """Return codes in words: as the log itself names them, else as they are today."""
    names: Mapping[int, str] = {code.value: code.name for code in codes}
    if isinstance(named, dict):
        names = {int(code): str(name) for code, name in named.items() if str(code).isdecimal()}
    return {code: name.lower().replace("_", " ") for code, name in names.items()}
