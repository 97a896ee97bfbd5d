"""What is done with one log, step by step: scan it where it is long, then look at its windows."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from motorctl.fleet.findings import Refusal, Row, nothing_row
from motorctl.fleet.head import Declared, LogHead
from motorctl.fleet.look import look_at_window, scan
from motorctl.long_logs.windows import MOST_ROWS, Window, clearest, whole_log, windows_of

SCANNED_ROWS = 1 << 22
"""Rows that one task scans. Larger shares a log among fewer workers, smaller gives the scheduler
more to do. Chosen by hand: a quarter of an hour at 5 kHz, some seconds of work."""


@dataclass(frozen=True)
class Task:
    """A call for a worker, and the share of its log that is done with it."""

    call: Callable[..., Any]
    arguments: tuple[Any, ...]
    share: float


Steps = Generator[list[Task], list[Any], list[Row] | Refusal]
"""Yields tasks, one at least; is sent their results in the same order; returns what is kept."""
SCANNING = 0.2
"""Share of a long log that its scan is. For progress alone."""


def steps_of(head: LogHead, declared: Declared, diagnoses: int) -> Steps:
    """Look at a log.

    Parameters
    ----------
    head
        What it says of itself.
    declared
        Which model is meant.
    diagnoses
        So many windows of each axis are searched for what the model lacks.
    """
    if head.rows <= MOST_ROWS:
        windows = {axis: [whole_log(axis, head.group_rows)] for axis in head.moved}
        left = 1.0
    else:
        spans = _spans(head.group_rows)
        scanned = yield [Task(scan, (head, declared, s), SCANNING / len(spans)) for s in spans]
        for part in scanned:
            if isinstance(part, Refusal):
                return part
        windows = _planned(head, scanned)
        left = 1.0 - SCANNING
    rows: list[Row] = [
        nothing_row(head, axis, f"{head.source}: axis {axis}: no motion that tells a parameter")
        for axis, found in windows.items()
        if not found
    ]
    asked = [
        (window, window.number in clearest(found, diagnoses))
        for found in windows.values()
        for window in found
    ]
    if not asked:
        return rows
    brief = replace(head, group_rows=(), moved={})  # of hours it is long, and windows are many
    looked = yield [
        Task(look_at_window, (brief, declared, window, diagnose), left / len(asked))
        for window, diagnose in asked
    ]
    for part in looked:
        if isinstance(part, Refusal):
            return part
        rows += part
    return rows


def _spans(group_rows: tuple[int, ...]) -> list[range]:
    spans, begin, rows = [], 0, 0
    for k, count in enumerate(group_rows):
        rows += count
        if rows >= SCANNED_ROWS or k == len(group_rows) - 1:
            spans.append(range(begin, k + 1))
            begin, rows = k + 1, 0
    return spans


def _planned(head: LogHead, scanned: list[Mapping[str, Any]]) -> dict[str, list[Window]]:
    period_s = 1.0 / head.rate_hz if head.rate_hz else 0.0
    return {
        axis: windows_of(
            axis, head.group_rows, [each for part in scanned for each in part[axis]], period_s
        )
        for axis in head.moved
    }
