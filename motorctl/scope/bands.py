"""States and faults in words, as a band below the time axis shows them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log.sample import AxisState, FaultCause
from motorctl.scope.opened_log import OpenedLog
from motorctl.scope.pyramid import PATIENCE_S

MOST_STRETCHES = 400
"""Of an axis' band; more are joined to stretches of changing states. Nobody sees more at once."""
CHANGING = "changing"


def bands(opened: OpenedLog, begin_s: float, end_s: float) -> dict[str, Any]:
    """Return the states of each axis over a stretch of time, for JSON.

    Parameters
    ----------
    opened
        The log.
    begin_s, end_s
        From when to when [s] by the log's own clock.

    Returns
    -------
    dict
        `axes`: of each axis that tells its state a list of stretches with `from_s`, `to_s`,
        `state` and, where it is in fault, `fault`; `coarse`: whether to ask again for more.
    """
    first, last = opened.rows_between(begin_s, end_s)
    told: dict[str, Any] = {"axes": {}, "coarse": False}
    enough = time.monotonic() + PATIENCE_S
    for axis in opened.log.axes:
        if f"{axis}.state" not in opened.log or last <= first:
            continue
        rows, codes, coarse = _changes(opened, axis, first, last, enough)
        told["coarse"] |= coarse
        told["axes"][axis] = _stretches(opened, rows, codes, last)
    return told


def _changes(
    opened: OpenedLog, axis: str, first: int, last: int, enough: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], bool]:
    """Return the rows at which state or cause change, with both as one code; -1: not read yet."""
    pyramid = opened.pyramid
    names = [f"{axis}.state", f"{axis}.fault"]
    names = [name for name in names if name in opened.log]
    rows, codes, coarse = [], [], False
    for k in pyramid.pieces(first, last):
        known = [pyramid.extremes(name) for name in names]
        begin = max(int(pyramid.begins[k]), first)
        end = min(pyramid.end(k), last)
        if all(found.low[k] == found.high[k] for found in known):
            found_rows, found_codes = [begin], [_code(*(int(f.low[k]) for f in known))]
        elif time.monotonic() > enough and all(np.isfinite(found.low[k]) for found in known):
            found_rows, found_codes, coarse = [begin], [-1], True
        else:
            code = _code(*(pyramid.rows(name, begin, end).astype(int) for name in names))
            at = np.flatnonzero(np.diff(code, prepend=-2))
            found_rows, found_codes = list(begin + at), list(code[at])
        rows += found_rows
        codes += found_codes
    all_rows, all_codes = np.array(rows, np.int64), np.array(codes, np.int64)
    new = np.flatnonzero(np.diff(all_codes, prepend=-2))
    return all_rows[new], all_codes[new], coarse


def _code(state: Any, fault: Any = 0) -> Any:
    return state * 256 + fault


def _stretches(
    opened: OpenedLog, rows: NDArray[np.int64], codes: NDArray[np.int64], last: int
) -> list[dict[str, Any]]:
    ends = [*rows[1:].tolist(), last - 1]
    states = _words(opened.log.metadata.get("states"), AxisState)
    faults = _words(opened.log.metadata.get("faults"), FaultCause)
    joined = -(-len(rows) // MOST_STRETCHES)
    told = []
    for k in range(0, len(rows), joined):
        state, fault = divmod(int(codes[k]), 256)
        several = joined > 1 or codes[k] < 0
        stretch = {
            "from_s": opened.time_of(int(rows[k])),
            "to_s": opened.time_of(int(ends[min(k + joined, len(rows)) - 1])),
            "state": CHANGING if several else states.get(state, f"state {state}"),
        }
        if not several and state == AxisState.FAULT:
            stretch["fault"] = faults.get(fault, f"cause {fault}")
        told.append(stretch)
    return told


def _words(named: object, codes: type[AxisState] | type[FaultCause]) -> dict[int, str]:
    """Return codes in words: as the log itself names them, else as they are today."""
    names: Mapping[int, str] = {code.value: code.name for code in codes}
    if isinstance(named, dict):
        names = {int(code): str(name) for code, name in named.items() if str(code).isdecimal()}
    return {code: name.lower().replace("_", " ") for code, name in names.items()}
