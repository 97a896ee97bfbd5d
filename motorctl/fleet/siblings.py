"""A machine beside its siblings: the same parameter of the same axis under the same program."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from motorctl.fleet.change import (
    FEWEST_POINTS,
    MAD,
    SAME,
    Level,
    drawn_in,
    never_differs,
    scatter_of,
    stands,
    steps_in,
)
from motorctl.fleet.head import SIMULATED
from motorctl.fleet.series import Series

Array = NDArray[np.float64]

LATEST = 9
"""Points whose median is a machine's level. More tell later what became of it, fewer tell it less
exactly. Chosen by hand: three days at three points a day."""
FEWEST_SIBLINGS = 9
"""Others that a machine needs to be compared. Fewer do not tell how much they scatter, more leave
small fleets without. Chosen by hand: a tenth machine is the first that could be told."""
OF_MEDIAN = math.pi / 2.0
"""Variance of a median over that of a mean. Arithmetic, of a normal distribution."""
OF_SPREAD = 1.36
"""Variance of the spread by the median deviation, times the number of values, over its square.
Arithmetic, of a normal distribution: an efficiency of 0.37."""
FREEDOM = 0.37
"""Degrees of freedom of that spread for each value. Larger has more false alarms than are stated,
smaller tells less. Arithmetic, from the same efficiency."""
SMALL = 0.8
"""How the median deviation of few values is too small: by (n - this) / n. Published by Croux and
Rousseeuw, Time-efficient algorithms for two highly robust estimators of scale, 1992."""


@dataclass(frozen=True)
class Standing:
    """Where a machine is among its siblings."""

    level: Level
    """Of its latest points."""
    median: float
    """Of the others' levels."""
    spread: float
    """Standard deviation of them, by their median deviation."""
    others: int
    z: float
    """The distance from the median over the spread."""
    z_error: float
    """Standard error of that."""
    p_value: float
    """How probably one of so many siblings that are alike is so far away."""

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        return {**vars(self), "level": vars(self.level)}


def latest_level(value: Array) -> Level:
    """Return what a series is by its latest points, whatever it was before.

    Of one that is too short to be judged, never differs, or stands at one value for a large part,
    its plain standard deviation counts.

    Parameters
    ----------
    value
        In order of time, (N,).
    """
    if len(value) < 3:
        return Level(float(np.median(value)), math.inf, len(value))
    last = value[-LATEST:]
    if len(value) < FEWEST_POINTS or never_differs(value) or stands(value):
        scatter, together = float(np.std(value, ddof=1)), 1.0
    else:
        clean, noise = drawn_in(value)
        scatter, together = scatter_of(clean, steps_in(clean, noise), noise)
    error = scatter * math.sqrt(OF_MEDIAN * together / len(last))
    return Level(float(np.median(last)), error, len(last))


def standings(series: Sequence[Series], levels: Sequence[Level]) -> list[Standing | None]:
    """Return where each machine stands; None where it has too few siblings.

    Each is compared with the median of all others and their spread about it. What of its own error
    goes beyond theirs is taken into account: theirs is in their spread already.

    Parameters
    ----------
    series, levels
        All of the fleet, and the level of each.
    """
    groups: dict[tuple[object, ...], list[int]] = defaultdict(list)
    for k, each in enumerate(series):
        simulated = each.machine.endswith(SIMULATED)
        groups[each.axis, each.program, each.name, each.unit, simulated].append(k)
    found: list[Standing | None] = [None] * len(series)
    for places in groups.values():
        if len(places) <= FEWEST_SIBLINGS:
            continue
        value, error = (
            np.array([getattr(levels[k], name) for k in places]) for name in ("value", "std_error")
        )
        for at, k in enumerate(places):
            found[k] = _standing(levels[k], np.delete(value, at), np.delete(error, at))
    return found


def _standing(level: Level, value: Array, error: Array) -> Standing | None:
    n = len(value)
    median = float(np.median(value))
    spread = MAD * float(np.median(np.abs(value - median))) * n / (n - SMALL)
    usual_error = float(np.median(error))
    spread = max(spread, usual_error, SAME * abs(median))
    if not spread or not math.isfinite(level.std_error):
        return None
    away = level.value - median
    more = max(0.0, level.std_error**2 - usual_error**2)
    z = away / spread
    z_error = math.sqrt((level.std_error / spread) ** 2 + (OF_MEDIAN + OF_SPREAD * z**2) / n)
    t = abs(away) / math.sqrt(spread**2 * (1.0 + OF_MEDIAN / n) + more)
    p = 2.0 * float(special.stdtr(FREEDOM * n, -t))
    return Standing(level, median, spread, n, z, z_error, p)
