"""Which stretches of a long log are read: where the model leaves most, and where motion tells most.

Motion alone would miss what happens in a part of the log only; what is left alone would read the
same event many times, and nothing of the sound hours beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from motorctl.long_logs.windows import Window

WHERE_MOST_IS_LEFT = 1.0 / 3.0
"""Share of the rows that are read where the declared model leaves most. Larger reads less of what
is usual, smaller sees less of what is not. Chosen by hand."""
ALIKE = math.log(2.0)
"""Differences of clearness up to which windows tell alike: standard errors within a factor of two.
Larger reads weaker motion, smaller reads one busy hour and no other. Chosen by hand."""


MUCH_MORE = 2.0
"""How many times the rms that the model leaves in what is read may be left elsewhere, unread,
before that is told. Larger keeps silent, smaller tells of noise. Chosen by hand."""


def most_left_and_clearest(
    windows: Sequence[Window], most_rows: int
) -> tuple[list[Window], list[Window]]:
    """Return the windows in which the declared model leaves most, and others that tell most.

    Parameters
    ----------
    windows
        Of an axis.
    most_rows
        Of both together.
    """
    reserved: list[Window] = []
    by_left = sorted(windows, key=lambda each: (-each.left_rms, each.number))
    rows = 0
    for window in by_left:
        if rows + window.rows <= WHERE_MOST_IS_LEFT * most_rows:
            reserved.append(window)
            rows += window.rows
    others = clearest_within(windows, most_rows - rows, reserved)
    worst = by_left[0]
    beside = [each.left_rms for each in (*reserved, *others) if each is not worst]
    if worst not in reserved and worst.left_rms > MUCH_MORE * max(beside, default=math.inf):
        reserved = [worst]  # larger than that share of the rows, and not to be missed
        others = clearest_within(windows, most_rows - worst.rows, reserved)
    return reserved, others


def clearest_within(
    windows: Sequence[Window], most_rows: float, already: Sequence[Window] = ()
) -> list[Window]:
    """Return the windows whose motion tells most, of so many rows at most.

    Of those that tell alike, each next one is the furthest in time from all that were taken: what
    happens in a part of the log only is then met.

    Parameters
    ----------
    windows
        Of an axis.
    most_rows
        Of those that are returned. Without `already` one window at least is.
    already
        Those that are read anyhow; they are not returned.
    """
    known = {window.number for window in already}
    left = [window for window in windows if window.number not in known]
    if not left:
        return []
    best = max(window.clearness for window in windows)
    levels: dict[int, list[Window]] = {}
    for window in left:
        levels.setdefault(int((best - window.clearness) / ALIKE), []).append(window)
    taken: list[Window] = []
    rows = 0
    for level in sorted(levels):
        waiting = levels[level]
        far = {
            window.number: min(
                (_apart(window, other) for other in (*already, *taken)), default=math.inf
            )
            for window in waiting
        }
        while True:
            if taken or already:
                waiting = [each for each in waiting if rows + each.rows <= most_rows]
            if not waiting:
                break
            window = max(waiting, key=lambda each: (far[each.number], each.clearness))
            waiting.remove(window)
            taken.append(window)
            rows += window.rows
            for other in waiting:
                far[other.number] = min(far[other.number], _apart(window, other))
    return taken


def _apart(one: Window, other: Window) -> float:
    return abs(one.middle_row - other.middle_row)
