"""Whether and when a series changed: steps, or a drift, beside how it scatters anyway."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
import ruptures
from numpy.typing import NDArray
from scipy import stats
from scipy.ndimage import median_filter

Array = NDArray[np.float64]

FEWEST_POINTS = 8
"""Points that a series needs before it is judged. Fewer give no idea of its scatter, more tell of
new machines later. Chosen by hand: under three days at three points a day."""
SHORTEST_PART = 3
"""Points that a change must last. Fewer take outliers for changes, more tell later. Chosen by hand:
a day at three points a day."""
NEIGHBOURS = 2 * SHORTEST_PART - 1
"""Points whose median an outlier is told by: fewer than `SHORTEST_PART` of them do not move it."""
FAR = 3.0
"""Standard deviations from that median beyond which a point is drawn in. Larger lets outliers make
changes, smaller bends what merely scatters. Chosen so that three points of which two are outliers
differ by less than is told; of 3, 3.5 and 4 on simulated series with two outliers at the end."""
PENALTY = 6.0
"""What a further change must gain, in logarithms of the number of points and squares of the
scatter. Larger misses changes that the test would confirm, smaller gives it more to refuse. As the
Bayesian criterion counts a place and a value, twice again for neighbours that are alike."""
MOST_CORRELATED = 0.98
"""Most correlation between neighbours that is believed. Larger never tells a drift of a slow
series, smaller takes its wandering for one. Chosen of 0.9 and 0.98 on simulated random walks."""
DOUBT = 2.0
"""What is added to that correlation, over the root of the number of points, as so few tell it
roughly. Larger tells drifts of new machines later, smaller has more false alarms than are stated.
Chosen of 1.5 and 2 on simulated series with a change and without, correlated by 0 to 0.8."""
SAME = 1e-9
"""Part of values, or of their range, within which they do not differ. Larger hides changes of what
hardly scatters, smaller takes rounding for one. Chosen by hand."""
MOST_EQUAL = 1.0 / 3.0
"""Part of the points that may have one value, as a bound, for a series to be judged by its scatter.
Larger takes what leaves a bound now and then for changes, smaller judges rounded values less
sharply. Chosen by hand: beyond half the median difference says nothing of the scatter."""
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
    """The first point after a step; where a drift begins."""
    before: Level
    """Of a drift its line where it begins."""
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


def change_in(value: Array, beside: Array | None = None) -> Change | None:
    """Return the clearest change of a series; None where it is too short or never differs.

    Points far from their neighbours are drawn in first, so that fewer than `SHORTEST_PART` make no
    change. Steps are sought by least squares with a penalty for each (ruptures). Each is tested by
    Student's t, times the places that it could have had; a drift by the slope of a straight line,
    and one that begins inside by the slope of a line that is level before, times the places of its
    beginning. What a point's neighbour tells of it is taken away before (see `p_value_of`). Of the
    three forms the one that leaves least for its parameters counts, and its probability three
    times.

    A series that stands at one value for a large part, as at a bound, has no such scatter: there
    only steps are sought, and counted is how many points lie beyond them (see `_step_of_counts`).

    Parameters
    ----------
    value
        In order of time, (N,).
    beside
        Of a series from which what covariates move was taken: they, (N, m). As far as a change
        looks like them its error is larger.
    """
    n = len(value)
    beside = np.empty((n, 0)) if beside is None else beside
    if n < FEWEST_POINTS or never_differs(value):
        return None
    if stands(value):
        return _step_of_counts(value)
    value, noise = drawn_in(value)
    steps = steps_in(value, noise)
    scatter, together = scatter_of(value, steps, noise)
    ends = [0, *steps, n]
    left_by_steps = sum(_squares(value[a:b]) for a, b in pairwise(ends))
    tested = _steps(value, beside, ends, scatter, together, noise)
    forms = [_drift(value, beside, 0, 1, noise)]
    if n > FEWEST_POINTS + 1:
        forms.append(_drift(value, beside, *beginning_of(value), noise))
    if tested:
        best = min(tested, key=lambda change: change.p_value)
        forms.append((criterion(left_by_steps, n, 2 * len(steps) + 1), best))
    _, best = min(forms, key=lambda form: form[0])
    return replace(best, p_value=min(1.0, 3.0 * best.p_value))


def never_differs(value: Array) -> bool:
    """Return whether a series is the same all the time, but for rounding."""
    size = float(np.max(np.abs(value), initial=0.0))
    return not len(value) or float(np.ptp(value)) <= SAME * size


def stands(value: Array) -> bool:
    """Return whether so many points have one value that the others are no scatter about it."""
    if not len(value):
        return False
    ordered = np.sort(value)
    near = SAME * max(float(np.max(np.abs(value))), float(np.ptp(value)))
    most = np.searchsorted(ordered, ordered + near, side="right") - np.arange(len(value))
    return int(np.max(most)) > MOST_EQUAL * len(value)


def told_alone(column: Array, beside: Array) -> float:
    """Return which part of a form's squares covariates do not look like, above 0 to 1.

    Parameters
    ----------
    column
        The form that a change has, (N,).
    beside
        Covariates, (N, m).
    """
    if not beside.shape[1]:
        return 1.0
    own = column - np.mean(column)
    others = beside - np.mean(beside, axis=0)
    left = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
    return max(float(left @ left) / float(own @ own), SAME)


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
    return rest_scatter(left, len(steps), noise)


def rest_scatter(left: Array, further: int, noise: float) -> tuple[float, float]:
    """Return the same of what a form with so many parameters beside one mean leaves."""
    n = len(left)
    squares = max(float(left @ left), n * noise**2 * SAME)
    # each mean or slope that was taken away hides about one neighbour's likeness
    doubt = DOUBT / math.sqrt(n) + 2.0 * further / n
    alike = float(left[1:] @ left[:-1]) / squares if squares > 0.0 else 0.0
    correlated = alike + doubt
    correlated = float(np.clip(correlated, 0.0, MOST_CORRELATED))
    freedom = max(n - 1 - further, 1)
    return max(noise, math.sqrt(squares / freedom)), (1.0 + correlated) / (1.0 - correlated)


def drawn_in(value: Array) -> tuple[Array, float]:
    """Return a series whose outliers are drawn in to their neighbours, and its noise."""
    around = median_filter(value, size=NEIGHBOURS)
    inside = NEIGHBOURS // 2
    around[:inside], around[-inside:] = around[inside], around[-inside - 1]
    kept, noise = value, 0.0
    for _ in range(2):  # where most points are equal, outliers are in the first noise
        noise = max(_noise(kept), SAME * float(np.ptp(value)))
        kept = np.clip(value, around - FAR * noise, around + FAR * noise)
    return kept, noise


def steps_in(value: Array, noise: float) -> list[int]:
    """Return the first points after each step."""
    if not noise > 0.0 or len(value) < 2 * SHORTEST_PART:
        return []
    search = ruptures.KernelCPD(kernel="linear", min_size=SHORTEST_PART)
    scaled = (value - np.median(value)) / noise
    ends = search.fit(scaled[:, None]).predict(pen=PENALTY * math.log(len(value)))
    return [int(end) for end in ends[:-1]]


def _steps(
    value: Array,
    beside: Array,
    ends: Sequence[int],
    scatter: float,
    together: float,
    noise: float,
) -> list[Change]:
    """Return each step between parts of a series.

    Each is tested as if it were the only one: parts are sought in noise, too, and between many of
    them neighbours look less alike than they are.
    """
    n = len(value)
    places = max(n - 2 * SHORTEST_PART + 1, 1)
    found = []
    for a, b, c in zip(ends, ends[1:], ends[2:], strict=False):
        form = np.asarray(np.arange(n) >= b, np.float64)
        alike = scatter_of(value, [b], noise)[1]
        p = p_value_of(value, form, beside, max(alike, together), noise)
        alone = told_alone(form[a:c], beside[a:c])
        before, after = (
            _level(part, scatter, together / alone) for part in (value[a:b], value[b:c])
        )
        found.append(Change("step", b, before, after, scatter, min(1.0, places * p)))
    return found


def p_value_of(value: Array, form: Array, beside: Array, together: float, noise: float) -> float:
    """Return how probably a form would have such a size where there is none.

    From each point what the one before tells of it is taken away, so what is left is independent:
    a step stands out at its first point already, however alike neighbours are.

    Parameters
    ----------
    value
        The series, (N,).
    form
        Its column, (N,).
    beside
        Covariates, (N, m).
    together
        How many points tell as much as a new one would.
    noise
        The least standard deviation that is believed.
    """
    correlated = (together - 1.0) / (together + 1.0)
    columns = np.column_stack([form, value, np.ones(len(value)), beside])
    free = columns[1:] - correlated * columns[:-1]
    free = np.vstack([math.sqrt(1.0 - correlated**2) * columns[:1], free])
    others = free[:, 2:]
    left = free[:, :2] - others @ np.linalg.lstsq(others, free[:, :2], rcond=None)[0]
    own, target = left.T
    squares = float(own @ own)
    if squares <= SAME * float(free[:, 0] @ free[:, 0]):  # covariates are all of it
        return 1.0
    size = float(own @ target) / squares
    rest = target - size * own
    freedom = max(len(value) - others.shape[1] - 2, 1)  # the form, and how alike neighbours are
    scatter = max(noise, math.sqrt(float(rest @ rest) / freedom))
    t = abs(size) * math.sqrt(squares) / scatter
    return 2.0 * float(stats.t.sf(t, freedom))


def _step_of_counts(value: Array) -> Change:
    """Return the clearest step of a series that stands at one value for a large part.

    Beyond the middle between both levels lie so many points before, and so many after: how probable
    that is among all orders of the same points is counted (Fisher), times the places of the step
    and of the middle, and twice, as a step is held against its neighbours and all there is. Points
    that lie beyond it one after the other count for less.
    """
    n = len(value)
    noise = max(float(np.std(np.diff(value))) / math.sqrt(2.0), SAME * float(np.ptp(value)))
    steps = steps_in(value, noise)
    scatter, together = scatter_of(value, steps, noise)
    places = max(n - 2 * SHORTEST_PART + 1, 1) * max(len(np.unique(value)) - 1, 1)
    found: list[Change] = []
    ends = [0, *steps, n]
    near = zip(ends, ends[1:], ends[2:], strict=False)
    for a, b, c in (*near, *((0, step, n) for step in steps)):  # its neighbours, and all there is
        before, after = (_level(part, scatter, together) for part in (value[a:b], value[b:c]))
        above = value[a:c] > 0.5 * (before.value + after.value)
        parts = above[: b - a], above[b - a :]
        left = np.concatenate([part - np.mean(part) for part in parts])
        like = rest_scatter(left, 1, 0.0)[1]
        counts = np.array([[np.sum(part), np.sum(~part)] for part in parts])
        told = stats.fisher_exact(np.floor(counts / like).astype(int))
        p = min(1.0, 2.0 * places * float(told.pvalue))
        found.append(Change("step", b, before, after, scatter, p))
    level = _level(value, scatter, together)
    none = Change("step", n - SHORTEST_PART, level, level, scatter, 1.0)
    return min(found, key=lambda change: change.p_value, default=none)


def beginning_of(value: Array) -> tuple[int, int]:
    """Return where a drift that begins inside fits best, and how many places it could have had.

    As many points as make a series lie after it: of fewer nobody can tell it from a step.
    """
    n = len(value)
    rising = n - 1.0 - np.arange(1, n - FEWEST_POINTS)  # points after each beginning
    total, squares = (
        rising * (rising + 1.0) / 2.0,
        rising * (rising + 1.0) * (2 * rising + 1.0) / 6.0,
    )
    after = np.cumsum((value - np.mean(value))[::-1])  # of the last 1, 2, … points
    product = np.cumsum(after)[rising.astype(int) - 1]
    explained = product**2 / (squares - total**2 / n)
    return 1 + int(np.argmax(explained)), len(rising)


def _drift(
    value: Array, beside: Array, first: int, places: int, noise: float
) -> tuple[float, Change]:
    """Return how badly a line fits that is level up to a point, and the change that it tells."""
    n = len(value)
    rise = np.maximum(0.0, np.arange(n) - float(first))
    columns = np.column_stack([np.ones(n), rise])
    inverse = np.linalg.inv(columns.T @ columns)
    line = inverse @ (columns.T @ value)
    left = value - columns @ line
    parameters = 3 if first else 2
    scatter, together = rest_scatter(left, parameters - 1, noise)
    covariance = scatter**2 * together / told_alone(rise, beside) * inverse
    p = min(1.0, places * p_value_of(value, rise, beside, together, noise))
    before, after = (
        Level(float(at @ line), math.sqrt(at @ covariance @ at), n)
        for at in (columns[first], columns[-1])
    )
    fit = criterion(float(left @ left), n, parameters)
    return fit, Change("drift", first, before, after, scatter, p)


def _level(part: Array, scatter: float, together: float) -> Level:
    error = scatter * math.sqrt(together / len(part))
    return Level(float(np.mean(part)), error, len(part))


def criterion(left: float, n: int, parameters: int) -> float:
    """Return how badly a form fits, by the squares that it leaves and its parameters."""
    return n * math.log(max(left, 1e-300) / n) + parameters * math.log(n)


def _squares(part: Array) -> float:
    return float(np.sum((part - np.mean(part)) ** 2))


def _noise(value: Array) -> float:
    """Return a point's standard deviation by its neighbours, whatever few of them do."""
    differences = np.diff(value)
    usual = MAD * float(np.median(np.abs(differences - np.median(differences))))
    # where most do not differ, as rounded values, those that do tell it
    return (usual or float(np.std(differences))) / math.sqrt(2.0)
