"""What changed in a fleet, with few false alarms, and what to look at first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from scipy import stats

from motorctl.errors import UsageError
from motorctl.fleet.change import Change, change_in
from motorctl.fleet.series import Series, series_of
from motorctl.fleet.store import Store
from motorctl.json_values import plain

DAYS = 365.0
LEAST_SIZE = 2.5
"""Standard deviations of a point by which a series must have changed to be told. Larger misses
small changes that last, smaller takes slow wandering for changes. Chosen on simulated series
without change: of those whose neighbours are correlated by 0.6, none of 500 is told at 1e-4."""


@dataclass(frozen=True)
class Alarm:
    """A parameter that changed."""

    series: Series
    change: Change
    adjusted: float
    """The level at which alarms would just include it (Benjamini-Hochberg over the fleet)."""

    @property
    def since(self) -> tuple[datetime, datetime]:
        """The last point before and the first one after; of a drift its beginning and the last."""
        if self.change.form == "drift":
            return self.series.moment(self.change.first), self.series.moment(-1)
        return self.series.moment(self.change.first - 1), self.series.moment(self.change.first)

    @property
    def log(self) -> str:
        """A log to look at: the first one after the step, or the last one of a drift."""
        place = -1 if self.change.form == "drift" else self.change.first
        return self.series.sources[place]

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        series, change = self.series, self.change
        last_before, first_after = self.since
        document = {
            "machine": series.machine,
            "axis": series.axis,
            "program": series.program,
            "parameter": series.name,
            "unit": series.unit,
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
class FleetChanges:
    """What changed: alarms, first those to look at first."""

    alarms: tuple[Alarm, ...]
    series: int
    """That were judged."""
    too_short: int
    """That have too few points, or never differ."""
    of_other_models: int
    """Values of these series that were left out because another model than the last gave them."""
    level: float
    """Of Benjamini and Hochberg's procedure."""
    false_alarms_a_year: float
    """Looks with a false alarm that are expected a year where nothing changes, at most."""

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``fleet changes --json``."""
        return {**vars(self), "alarms": [alarm.to_dict() for alarm in self.alarms]}


def changes_in(
    store: Store, *, false_alarms_a_year: float = 1.0, looks_a_day: float = 1.0
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
    level = false_alarms_a_year / (DAYS * looks_a_day) if looks_a_day > 0.0 else np.inf
    if not 0.0 < level < 1.0:
        raise UsageError(
            f"{false_alarms_a_year:g} false alarms a year at {looks_a_day:g} looks a day: should "
            "be more than none, and less than one each look"
        )
    return judged(series_of(store), level, false_alarms_a_year)


def judged(series: Sequence[Series], level: float, false_alarms_a_year: float) -> FleetChanges:
    """Return the alarms of some series at a level; first the largest beside its usual scatter."""
    found = [(each, change) for each in series if (change := change_in(each.value)) is not None]
    alarms: list[Alarm] = []
    if found:
        probable = [c.p_value if c.size >= LEAST_SIZE else 1.0 for _, c in found]
        adjusted = stats.false_discovery_control(probable)
        told = zip(found, adjusted, strict=True)
        alarms = [Alarm(each, change, float(q)) for (each, change), q in told if q <= level]
    alarms.sort(key=lambda alarm: (-alarm.change.size, alarm.series.machine, alarm.series.name))
    return FleetChanges(
        tuple(alarms),
        len(found),
        len(series) - len(found),
        sum(each.of_other_models for each in series),
        level,
        false_alarms_a_year,
    )
