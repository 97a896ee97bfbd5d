"""What changed in a fleet, with few false alarms, and what to look at first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from motorctl.errors import UsageError
from motorctl.fleet.change import Change, change_in, stands
from motorctl.fleet.covariates import MOST_MISSING, Covariates, usable
from motorctl.fleet.influence import (
    Influence,
    Remainder,
    change_beside,
    influence_on,
    remainder_of,
)
from motorctl.fleet.series import Seen, Series, series_of
from motorctl.fleet.siblings import Standing, latest_level, standings
from motorctl.fleet.store import Store
from motorctl.json_values import plain

Array = NDArray[np.float64]

DAYS = 365.0
LEAST_SIZE = 2.5
"""Standard deviations of a point by which a series must have changed to be told. Larger misses
small changes that last, smaller takes slow wandering for changes. Chosen on simulated series
without change: of those whose neighbours are correlated by 0.6, none of 500 is told at 1e-4."""
SURE = 3.0
"""Standard errors by which what is left of a change must differ from it for covariates to explain
it. Larger doubts them more often, smaller believes them sooner. Chosen by hand."""
HARDLY = 0.2
"""Part of a change that covariates must take away for it to be said to go with them, or not to be
told apart. Larger tells more alarms that covariates explain in part, smaller says so of changes
that have nothing to do with them. Chosen by hand."""


@dataclass(frozen=True)
class Judged:
    """A series that was judged."""

    series: Series
    change: Change
    """Beside its covariates, where there are some."""
    plain: Change
    """As it is."""
    influence: Influence | None
    standing: Standing | None

    def since(self, change: Change) -> tuple[datetime, datetime]:
        """Return the points around a step; of a drift its beginning and the last one."""
        if change.form == "drift":
            return self.series.moment(change.first), self.series.moment(-1)
        return self.series.moment(change.first - 1), self.series.moment(change.first)

    def to_dict(self) -> dict[str, Any]:
        """Return what is told of it whatever it is told for."""
        series = self.series
        return {
            "machine": series.machine,
            "axis": series.axis,
            "program": series.program,
            "parameter": series.name,
            "unit": series.unit,
            "siblings": self.standing and self.standing.to_dict(),
            "influence": self.influence and self.influence.to_dict(),
        }


@dataclass(frozen=True)
class Alarm:
    """A parameter that changed."""

    judged: Judged
    adjusted: float
    """The level at which alarms would just include it (Benjamini-Hochberg over all changes of the
    fleet; doubled where distances from siblings take the other half of the level)."""

    @property
    def series(self) -> Series:
        """Return the series."""
        return self.judged.series

    @property
    def change(self) -> Change:
        """Return what became of it."""
        return self.judged.change

    @property
    def since(self) -> tuple[datetime, datetime]:
        """The last point before and the first one after; of a drift its beginning and the last."""
        return self.judged.since(self.change)

    @property
    def point(self) -> int:
        """The point to look at: the first one after the step, or the last one of a drift."""
        return -1 if self.change.form == "drift" else self.change.first

    def around(self, most: int) -> tuple[tuple[Seen, ...], tuple[Seen, ...]]:
        """Return windows of the last points before it, and of as many after: of a drift the last.

        Parameters
        ----------
        most
            So many of each, at most.
        """
        seen, first = self.series.seen, self.change.first
        before = seen[max(0, first - most) : first] or seen[:most]
        drifts = self.change.form == "drift"
        return before, seen[-most:] if drifts else seen[first : first + most]

    @property
    def log(self) -> str:
        """A log to look at."""
        return self.series.seen[self.point].source

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        change = self.change
        last_before, first_after = self.since
        document = self.judged.to_dict() | {
            "form": change.form,
            "since": [last_before.isoformat(), first_after.isoformat()],
            "before": vars(change.before),
            "after": vars(change.after),
            "scatter": change.scatter,
            "size": change.size,
            "p_value": change.p_value,
            "adjusted": self.adjusted,
            "log": self.log,
        }
        return {key: plain(value) for key, value in document.items()}


@dataclass(frozen=True)
class Explained:
    """A change that goes with covariates, and is no alarm."""

    judged: Judged
    remainder: Remainder
    """What is left of it beside them."""

    @property
    def moved(self) -> float:
        """By how much the series changed as it is."""
        return self.judged.plain.after.value - self.judged.plain.before.value

    @property
    def certain(self) -> bool:
        """Whether they explain it; else the two cannot be told apart."""
        return abs(self.moved - self.remainder.value) > SURE * self.remainder.std_error

    @property
    def none_of_it(self) -> bool:
        """Whether nearly all of it is left beside them, for sure: then it is a change of its own.

        Only the further doubt that comes with covariates kept it from being told.
        """
        left = self.remainder
        taken = abs(self.moved - left.value)
        return taken <= HARDLY * abs(self.moved) and abs(left.value) > SURE * left.std_error

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        change = self.judged.plain
        document = self.judged.to_dict() | {
            "form": change.form,
            "since": [moment.isoformat() for moment in self.judged.since(change)],
            "changed_by": self.moved,
            "left": vars(self.remainder),
            "certain": self.certain,
        }
        return {key: plain(value) for key, value in document.items()}


@dataclass(frozen=True)
class Unlike:
    """A machine that is unlike its siblings."""

    judged: Judged
    standing: Standing
    adjusted: float

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        document = self.judged.to_dict() | {
            "adjusted": self.adjusted,
            "log": self.judged.series.seen[-1].source,
        }
        return {key: plain(value) for key, value in document.items()}


@dataclass
class CovariateUse:
    """For how many of the series that were judged a covariate was used."""

    name: str
    series: int = 0
    not_used: int = 0
    """Series that were judged without it: too few of their points have a reading, or it never
    varied there, or they are too short or stand at one value."""
    points_left_out: int = 0
    """Points without a reading, of series that were judged with it."""


@dataclass(frozen=True)
class FleetChanges:
    """What changed: alarms, first those to look at first."""

    alarms: tuple[Alarm, ...]
    unlike: tuple[Unlike, ...]
    """Machines that are unlike their siblings, first those that are most."""
    explained: tuple[Explained, ...]
    """Changes that would be alarms, and go with covariates."""
    judged: tuple[Judged, ...]
    unjudged: tuple[Series, ...]
    """That have too few points, or never differ."""
    series: int
    """That were judged."""
    too_short: int
    """That were not."""
    compared: int
    """Of those judged, that have siblings enough."""
    without_covariates: int
    """Of those judged, for which no covariate could be used."""
    covariates: tuple[CovariateUse, ...]
    of_other_models: int
    """Values of these series that were left out because another model than the last gave them."""
    level: float
    """Of Benjamini and Hochberg's procedure."""
    false_alarms_a_year: float
    """Looks with a false alarm that are expected a year where nothing changes, at most."""

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``fleet changes --json``."""
        document = {**vars(self)}
        del document["judged"], document["unjudged"]
        for key in ("alarms", "unlike", "explained"):
            document[key] = [each.to_dict() for each in document[key]]
        document["covariates"] = [vars(each) for each in self.covariates]
        return document


def changes_in(
    store: Store,
    *,
    false_alarms_a_year: float = 1.0,
    looks_a_day: float = 1.0,
    covariates: Covariates | None = None,
) -> FleetChanges:
    """Judge every series of a store.

    Parameters
    ----------
    store
        Of findings.
    false_alarms_a_year
        Looks with any false alarm that are accepted a year, over the whole fleet, if nothing
        changes.
    looks_a_day
        How often somebody asks.
    covariates
        What varied beside the machines; what goes with it is no alarm.

    Returns
    -------
    FleetChanges
        Its `level` is the share of false ones that is expected among the alarms, at most.

    Raises
    ------
    UsageError
        Where a number is out of range.
    DataError
        Where the store is damaged.
    """
    level = level_of(false_alarms_a_year, looks_a_day)
    return judged(series_of(store), level, false_alarms_a_year, covariates)


def level_of(false_alarms_a_year: float, looks_a_day: float) -> float:
    """Return the level at which so many looks a year have a false alarm. Raises UsageError."""
    level = false_alarms_a_year / (DAYS * looks_a_day) if looks_a_day > 0.0 else math.inf
    if not 0.0 < level < 1.0:
        raise UsageError(
            f"{false_alarms_a_year:g} false alarms a year at {looks_a_day:g} looks a day: should "
            "be more than none, and less than one each look"
        )
    return level


def judged(
    series: Sequence[Series],
    level: float,
    false_alarms_a_year: float,
    covariates: Covariates | None = None,
) -> FleetChanges:
    """Return the alarms of some series at a level; first the largest beside its usual scatter.

    Changes and distances from siblings are two families, each held against its share of the level:
    machines that always were unlike the others make no change more probable.
    """
    found, uses = _judged(series, covariates or Covariates())
    compared = [each.standing.p_value for each in found if each.standing is not None]
    families = 2 if compared else 1
    adjusted = _adjusted([_telling(each.change) for each in found], families)
    would = _adjusted([_telling(each.plain) for each in found], families)
    explained: list[Explained] = []
    alarms: list[Alarm] = []
    for k, (each, q, q_plain) in enumerate(zip(found, adjusted, would, strict=True)):
        if q <= level:
            alarms.append(Alarm(each, q))
        elif each.influence is not None and q_plain <= level:
            one = Explained(each, remainder_of(each.plain, each.series.value, each.influence))
            if one.none_of_it:
                found[k] = replace(each, change=each.plain, influence=None)
                alarms.append(Alarm(found[k], q_plain))
            else:
                explained.append(one)
    explained.sort(key=lambda one: -one.judged.plain.size)
    alarms.sort(key=lambda alarm: (-alarm.change.size, alarm.series.machine, alarm.series.name))
    apart = iter(_adjusted(compared, families))
    unlike = [
        Unlike(each, each.standing, q)
        for each in found
        if each.standing is not None and (q := next(apart)) <= level
    ]
    unlike.sort(key=lambda one: -abs(one.standing.z))
    return FleetChanges(
        tuple(alarms),
        tuple(unlike),
        tuple(explained),
        tuple(found),
        _without(series, found),
        len(found),
        len(series) - len(found),
        len(compared),
        sum(each.influence is None for each in found) if covariates else 0,
        uses,
        sum(each.of_other_models for each in series),
        level,
        false_alarms_a_year,
    )


def _judged(
    series: Sequence[Series], covariates: Covariates
) -> tuple[list[Judged], tuple[CovariateUse, ...]]:
    """Judge each series that is long enough and differs at all."""
    usual = covariates.usual()
    uses = [CovariateUse(name) for name in covariates.names]
    found: list[tuple[Series, Change, Change, Influence | None]] = []
    for whole in series:
        values = covariates.beside(whole.machine, whole.time_s)
        each, influence = _beside(whole, values - usual, covariates.names)
        plain_change = change_in(each.value)
        change = plain_change if influence is None else change_beside(influence)
        if plain_change is None or change is None:
            continue
        found.append((each, change, plain_change, influence))
        for use, known in zip(uses, np.isfinite(values).T, strict=True):
            used = influence is not None and use.name in influence.names
            use.series += used
            use.not_used += not used
            use.points_left_out += int(np.sum(~known)) if used else 0
    levels = [
        latest_level(each.value if influence is None else influence.adjusted)
        for each, _, _, influence in found
    ]
    stand = standings([each for each, _, _, _ in found], levels)
    judged = [Judged(*each, standing) for each, standing in zip(found, stand, strict=True)]
    return judged, tuple(uses)


def _beside(
    series: Series, values: Array, names: tuple[str, ...]
) -> tuple[Series, Influence | None]:
    """Return a series' points that have readings, and how it goes with them.

    Where too few points have readings, all of them are returned, and no influence.
    """
    # what stands at a bound follows nothing: a slope would move it away from there
    if not names or not len(series.value) or stands(series.value):
        return series, None
    use = usable(values)
    known = np.asarray(np.isfinite(values[:, use]).all(axis=1), np.bool_)
    if not use.any() or np.mean(known) < 1.0 - MOST_MISSING:
        return series, None
    part = series.only(known)
    used = tuple(name for name, kept in zip(names, use, strict=True) if kept)
    influence = influence_on(part.value, values[known][:, use], used)
    return (series, None) if influence is None else (part, influence)


def _without(series: Sequence[Series], found: Sequence[Judged]) -> tuple[Series, ...]:
    known = {each.series.key for each in found}
    return tuple(each for each in series if each.key not in known)


def _telling(change: Change) -> float:
    return change.p_value if change.size >= LEAST_SIZE else 1.0


def _adjusted(p_values: Sequence[float], families: int) -> list[float]:
    """Return each probability of a family after Benjamini and Hochberg, and times the families."""
    if not p_values:
        return []
    return [min(1.0, families * float(q)) for q in stats.false_discovery_control(p_values)]
