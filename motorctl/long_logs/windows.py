"""Which rows of a log are looked at together: those whose motion tells the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motorctl.identify.columns.measured import LONGEST_STRETCH
from motorctl.identify.fit.judgement import POORLY_DETERMINED
from motorctl.long_logs.excitation import Excitation, Usual, usual_of

MOST_ROWS = LONGEST_STRETCH
"""Most rows of a window: these bound what a worker holds. Larger takes more memory, smaller cuts
slow programs apart. As the longest stretch of an analysis: 105 s at 5 kHz."""
LONGEST_SPAN_S = 1800.0
"""Longest time between the first and the last row of a window [s]; rest between them is left out.
Larger gathers more of rare motion, smaller tells sooner when something changed. Chosen by hand."""


@dataclass(frozen=True)
class Window:
    """Rows of one axis that are fitted together."""

    axis: str
    number: int
    """From 0, in the log's order."""
    groups: tuple[int, ...]
    """The row groups; rest between them is left out."""
    rows: int
    clearness: float
    """The larger, the more its motion tells, whatever the model leaves of it."""
    vagueness: tuple[float, ...] = ()
    """What each term of the model moves within its standard error, in parts of the command; empty
    where it was not scanned."""
    left_rms: float = 0.0
    """What the declared model leaves of the command in it, with the parameters of the whole log."""
    middle_row: float = 0.0
    """Of the log."""


def whole_log(axis: str, group_rows: Sequence[int]) -> Window:
    """Return all of a short log as one window."""
    return Window(axis, 0, tuple(range(len(group_rows))), sum(group_rows), 0.0)


def windows_of(
    axis: str,
    group_rows: Sequence[int],
    told: Sequence[Excitation | None],
    period_s: float,
    first_number: int = 0,
    first_row: int = 0,
    usual: Usual | None = None,
) -> list[Window]:
    """Cut a long log into windows that carry enough motion to tell something.

    Row groups are gathered until every parameter is determined well enough for `fit` to make no
    note of it, until they are `MOST_ROWS`, or until they would span more than `LONGEST_SPAN_S`.
    Groups without motion are left out; a window that determines no parameter at all is dropped.
    That is judged by the motion alone, under the same noise everywhere: a window during which the
    model lacks something is as clear as one during which it does not.

    Parameters
    ----------
    axis
        Its name.
    group_rows
        Rows of each row group.
    told
        What each of them tells.
    period_s
        Between two rows.
    first_number
        Of the first window.
    first_row
        Of the first row group.
    usual
        What holds for the whole log; None: these row groups are all of it.

    Returns
    -------
    list of Window
        In the log's order; empty where the axis never moved enough.
    """
    usual = usual or usual_of(told)
    if usual is None:
        return []
    theta, variance = usual.theta, usual.variance
    begins = np.concatenate(([0], np.cumsum(group_rows)))
    found: list[Window] = []
    open_groups: list[int] = []
    open_told: Excitation | None = None

    def close() -> None:
        nonlocal open_groups, open_told
        if open_told is not None:
            vague = open_told.vagueness(variance)
            if (vague <= POORLY_DETERMINED).any():
                found.append(
                    Window(
                        axis,
                        first_number + len(found),
                        tuple(open_groups),
                        sum(group_rows[k] for k in open_groups),
                        float(-np.mean(np.log(np.clip(vague, 1e-9, 1e9)))),
                        tuple(map(float, vague)),
                        open_told.left_rms(theta),
                        first_row
                        + 0.5 * float(begins[open_groups[0]] + begins[open_groups[-1] + 1]),
                    )
                )
        open_groups, open_told = [], None

    for k, more in enumerate(told):
        if more is None:
            continue
        rows = sum(group_rows[j] for j in open_groups) + group_rows[k]
        if open_groups:
            span_s = (begins[k + 1] - begins[open_groups[0]]) * period_s
            if rows > MOST_ROWS or span_s > LONGEST_SPAN_S:
                close()
        open_groups.append(k)
        open_told = more if open_told is None else open_told.plus(more)
        if (open_told.vagueness(variance) <= POORLY_DETERMINED).all():
            close()
    close()
    return found


def clearest(windows: Sequence[Window], count: int) -> set[int]:
    """Return the numbers of the windows of an axis whose motion tells most, `count` at most."""
    ranked = sorted(windows, key=lambda window: (-window.clearness, window.number))
    return {window.number for window in ranked[:count]}
