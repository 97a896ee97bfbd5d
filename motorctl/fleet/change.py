"""Whether and when a series changed: steps, or a drift, beside how it scatters anyway."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import ruptures
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

FEWEST_POINTS = 8
"""Points that a series needs before it is judged. Fewer give no idea of its scatter, more tell of
new machines later. Chosen by hand: under three days at three points a day."""
SHORTEST_PART = 3
"""Points that a change must last. Fewer take outliers for changes, more tell later. Chosen by hand:
a day at three points a day."""
PENALTY = 6.0
"""What a further change must gain, in logarithms of the number of points and squares of the
scatter. Larger misses changes that the test would confirm, smaller gives it more to refuse. As the
Bayesian criterion counts a place and a value, twice again for neighbours that are alike."""
MOST_CORRELATED = 0.9
"""Most correlation between neighbours that is believed. Larger never tells anything of a slow
series, smaller takes its wandering for changes. Chosen by hand."""
DOUBT = 1.5
"""What is added to that correlation, over the root of the number of points, as so few tell it
roughly. Larger tells changes of new machines later, smaller has more false alarms than are stated.
Chosen of 1 and 1.5 on simulated series with a step and without, correlated by 0 to 0.6."""
SAME = 1e-9
"""Part of values, or of their range, within which they do not differ. Larger hides changes of what
hardly scatters, smaller takes rounding for one. Chosen by hand."""
MAD = 1.4826
"""Standard deviation over the median absolute deviation. Arithmetic, of a normal distribution."""


@dataclass(frozen=True)
class Level:
    """What a series was over some of its points."""

    value: float
    std_error: float
    """Of the mean, with neighbours counted as far as they tell anything new."""
    points: int


@dataclass(frozen=True)
class Change:
    """The clearest change of a series."""

    form: Literal["step", "drift"]
    first: int
    """The first point after a step; of a drift the first of all."""
    before: Level
    """Of a drift its line at the first point."""
    after: Level
    """Of a drift its line at the last point."""
    scatter: float
    """Standard deviation of one point."""
    p_value: float
    """How probably so clear a change is seen anywhere in a series without any."""

    @property
    def size(self) -> float:
        """By how many standard deviations of a point it changed."""
        return abs(self.after.value - self.before.value) / self.scatter


def change_in(value: Array) -> Change | None:
    """Return the clearest change of a series; None where it is too short or never differs.

    Steps are sought by least squares with a penalty for each (ruptures). Each is tested by
    Student's t between its neighbours, times the places that it could have had; a drift by the
    slope of a straight line. Points that follow each other are counted for as much as they tell
    that their neighbours do not. Of both forms the one that leaves less counts, and its
    probability twice.

    Parameters
    ----------
    value
        In order of time, (N,).
    """
    n = len(value)
    if n < FEWEST_POINTS:
        return None
    if float(np.ptp(value)) <= SAME * float(np.max(np.abs(value), initial=0.0)):
        return None
    noise = max(_robust(np.diff(value)) / math.sqrt(2.0), SAME * float(np.ptp(value)))
    steps = _steps(value, noise)
    noise, together = scatter_of(value, steps, noise)
    drift = _drift(value, noise, together)
    ends = [0, *steps, n]
    left_by_steps = sum(_squares(value[a:b]) for a, b in pairwise(ends))
    slope, offset = np.polyfit(np.arange(n), value, 1)
    left_by_drift = float(np.sum((value - offset - slope * np.arange(n)) ** 2))
    tested = [
        _step(value[a:c], b - a, a, noise, together, n)
        for a, b, c in zip(ends, ends[1:], ends[2:], strict=False)
    ]
    best = min(tested, key=lambda change: change.p_value, default=None)
    if best is None or _criterion(left_by_drift, n, 2) <= _criterion(
        left_by_steps, n, 2 * len(steps) + 1
    ):
        best = drift
    return Change(
        best.form, best.first, best.before, best.after, best.scatter, min(1.0, 2.0 * best.p_value)
    )


def scatter_of(value: Array, steps: Sequence[int], noise: float) -> tuple[float, float]:
    """Return a point's standard deviation, and how many points tell as much as a new one would.

    Parameters
    ----------
    value
        The series, (N,).
    steps
        The first points after each step; between them it is taken for constant.
    noise
        The least standard deviation that is believed.
    """
    ends = [0, *steps, len(value)]
    left = np.concatenate([value[a:b] - np.mean(value[a:b]) for a, b in pairwise(ends)])
    squares = max(float(left @ left), len(left) * noise**2 * SAME)
    # each mean that was taken away hides about one neighbour's likeness
    doubt = DOUBT / math.sqrt(len(value)) + 2.0 * len(steps) / len(value)
    correlated = float(left[1:] @ left[:-1]) / squares + doubt
    correlated = float(np.clip(correlated, 0.0, MOST_CORRELATED))
    freedom = max(len(value) - len(ends) + 1, 1)
    return max(noise, math.sqrt(squares / freedom)), (1.0 + correlated) / (1.0 - correlated)


def _steps(value: Array, noise: float) -> list[int]:
    """Return the first points after each step."""
    search = ruptures.KernelCPD(kernel="linear", min_size=SHORTEST_PART)
    scaled = (value - np.median(value)) / noise
    ends = search.fit(scaled[:, None]).predict(pen=PENALTY * math.log(len(value)))
    return [int(end) for end in ends[:-1]]


def _step(
    value: Array, split: int, begin: int, noise: float, together: float, all_points: int
) -> Change:
    parts = value[:split], value[split:]
    n = len(value)
    freedom = max(n / together - 2.0, 1.0)
    scatter = max(noise, math.sqrt(sum(_squares(part) for part in parts) / max(n - 2, 1)))
    before, after = (_level(part, scatter, together) for part in parts)
    error = math.hypot(before.std_error, after.std_error)
    moved = abs(after.value - before.value)
    t = moved / error
    places = max(all_points - 2 * SHORTEST_PART + 1, 1)
    p = min(1.0, places * 2.0 * float(stats.t.sf(t, freedom)))
    return Change("step", begin + split, before, after, scatter, p)


def _drift(value: Array, noise: float, together: float) -> Change:
    n = len(value)
    place = np.arange(n) - 0.5 * (n - 1)
    slope = float(place @ value / (place @ place))
    mean = float(np.mean(value))
    left = float(np.sum((value - mean - slope * place) ** 2))
    scatter = max(noise, math.sqrt(left / (n - 2)))
    error = scatter * math.sqrt(together / float(place @ place))
    freedom = max(n / together - 2.0, 1.0)
    t = abs(slope) / error
    p = 2.0 * float(stats.t.sf(t, freedom))
    at_end = math.hypot(scatter * math.sqrt(together / n), error * float(place[-1]))
    first, last = (Level(mean + slope * float(at), at_end, n) for at in (place[0], place[-1]))
    return Change("drift", 0, first, last, scatter, p)


def _level(part: Array, scatter: float, together: float) -> Level:
    error = scatter * math.sqrt(together / len(part))
    return Level(float(np.mean(part)), error, len(part))


def _criterion(left: float, n: int, parameters: int) -> float:
    return n * math.log(max(left, 1e-300) / n) + parameters * math.log(n)


def _squares(part: Array) -> float:
    return float(np.sum((part - np.mean(part)) ** 2))


def _robust(differences: Array) -> float:
    return MAD * float(np.median(np.abs(differences - np.median(differences))))
