"""The page of a fleet, from its store."""

from __future__ import annotations

import shlex
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pyarrow.dataset as ds

from motorctl.fleet.changes import (
    Alarm,
    Explained,
    FleetChanges,
    Judged,
    Unlike,
    judged,
    level_of,
)
from motorctl.fleet.covariates import Covariates
from motorctl.fleet.grown import Grown, Progress, names_of
from motorctl.fleet.report.machines import UNNAMED, MachineSeen, machines_in
from motorctl.fleet.report.trend import HEIGHT, SMALL_HEIGHT, SMALL_WIDTH, WIDTH, small, trend_of
from motorctl.fleet.series import COLUMNS, Seen, Series, newest_rows, series_from
from motorctl.fleet.siblings import latest_level
from motorctl.fleet.store import Store
from motorctl.html_pages import write_page

MOST_PICTURES = 60
"""Changes that are shown with a large picture; the others are rows of a table."""
MOST_REFUSED = 10
"""Logs of a machine that are named with why they cannot be used; the others are counted."""
CLEAR = 3.0
"""Standard errors from which on what a covariate moves is told beside an alarm."""
SILENT = timedelta(days=2)
"""How old a machine's last log is where that is pointed out; how young a step is that is called
new."""
PAGE_COLUMNS = (*COLUMNS, "kind", "text", "confidence")
PORT = 8765
"""Where the page's links expect the scope, unless another one is asked for."""


@dataclass(frozen=True)
class _Links:
    """Where the scope shows a window."""

    port: int

    def to(self, seen: Seen, axis: str) -> str:
        """Return the address of a window, with the layout that the scope's page reads."""
        layout: dict[str, Any] = {"axes": axis, "align": "time"}
        if seen.begin_s is not None and seen.end_s is not None:
            layout |= {"from": f"{seen.begin_s:.12g}", "to": f"{seen.end_s:.12g}"}
        return f"http://127.0.0.1:{self.port}/log/{seen.log_id}/#{urlencode(layout)}"

    def link(self, seen: Seen, axis: str, when: datetime | None, words: str) -> dict[str, Any]:
        """Return what a link is made of."""
        return {"to": self.to(seen, axis), "log": seen.source, "when": when, "words": words}


def write_fleet_page(
    store: Store,
    page: Path,
    *,
    false_alarms_a_year: float = 1.0,
    looks_a_day: float = 1.0,
    covariates: Covariates | None = None,
    scope_port: int = PORT,
    now: datetime | None = None,
    read_logs: Progress | None = None,
) -> FleetChanges:
    """Write a fleet as one self-contained page.

    Parameters
    ----------
    store
        Of findings.
    page
        The file.
    false_alarms_a_year, looks_a_day, covariates
        As `motorctl.fleet.changes.changes_in` takes them.
    scope_port
        Of the scope that links lead to.
    now
        Against which machines are silent; None: the time of this computer.
    read_logs
        Told how far it is with reading logs again, to name what grew where the fit leaves more;
        None: none is read.

    Returns
    -------
    FleetChanges
        What changed, as the page shows it.

    Raises
    ------
    UsageError
        Where a number is out of range, or the page cannot be written.
    DataError
        Where the store is damaged.
    """
    level = level_of(false_alarms_a_year, looks_a_day)
    rows = newest_rows(store, list(PAGE_COLUMNS))
    parameters = rows.filter(ds.field("kind") == "parameter")
    found = judged(series_from(parameters), level, false_alarms_a_year, covariates)
    machines = machines_in(rows, store.passing())
    links = _Links(scope_port)
    numbers = {name: k for k, name in enumerate(machines)}
    ends = [machine.last for machine in machines.values() if machine.last is not None]
    begins = [machine.first for machine in machines.values() if machine.first is not None]
    shown = found.alarms[:MOST_PICTURES]
    grown = {} if read_logs is None else names_of(shown, read_logs)
    write_page(
        page,
        __package__ or "",
        "page.html",
        store=str(store.folder),
        command=f"motorctl scope --store {shlex.quote(str(store.folder.resolve()))} "
        f"--port {scope_port}",
        found=found,
        named=sum(name != UNNAMED for name in machines),
        begin=min(begins, default=None),
        end=max(ends, default=None),
        logs=sum(len(machine.logs) for machine in machines.values()),
        refused=sum(len(machine.refused) for machine in machines.values()),
        covariates=() if covariates is None else covariates.names,
        large=(WIDTH, HEIGHT),
        small=(SMALL_WIDTH, SMALL_HEIGHT),
        alarms=[
            _alarm(alarm, found, links, numbers) | {"grown": _grown(grown.get(k))}
            for k, alarm in enumerate(shown)
        ],
        more=[_alarm_row(alarm, links, numbers) for alarm in found.alarms[MOST_PICTURES:]],
        unlike=[_unlike(one, links, numbers) for one in found.unlike],
        explained=[_explained(one, found, links, numbers) for one in found.explained],
        overview=_overview(machines, found, now or datetime.now(UTC)),
        machines=_machines(machines, found, links),
    )
    return found


def _place(one: Judged, numbers: dict[str, int]) -> dict[str, Any]:
    """Return what names a series."""
    series = one.series
    return {
        "machine": series.machine,
        "number": numbers[series.machine],
        "axis": series.axis,
        "program": series.program,
        "name": series.name,
        "unit": series.unit,
        "standing": one.standing,
        "influence": one.influence
        and list(
            zip(one.influence.names, one.influence.slope, one.influence.std_error, strict=True)
        ),
    }


def _alarm_row(alarm: Alarm, links: _Links, numbers: dict[str, int]) -> dict[str, Any]:
    series, change = alarm.series, alarm.change
    moved_by = _place(alarm.judged, numbers)["influence"] or ()
    before = 0 if change.form == "drift" else change.first - 1
    return _place(alarm.judged, numbers) | {
        "form": change.form,
        "moved_by": [each for each in moved_by if abs(each[1]) > CLEAR * each[2]],
        "since": alarm.since,
        "before": change.before,
        "after": change.after,
        "size": change.size,
        "links": [
            links.link(series.seen[at], series.axis, series.moment(at), words)
            for at, words in ((before, "before"), (alarm.point, "after"), (-1, "newest"))
        ][: 2 if change.form == "drift" else 3],
    }


def _alarm(
    alarm: Alarm, found: FleetChanges, links: _Links, numbers: dict[str, int]
) -> dict[str, Any]:
    series = alarm.series
    before, after = alarm.change.before.value, alarm.change.after.value
    newest = max(float(one.series.time_s[-1]) for one in found.judged)
    others = [
        f"{other.series.axis} {other.series.name}"
        for other in found.alarms
        if other is not alarm and other.series.machine == series.machine
    ]
    return _alarm_row(alarm, links, numbers) | {
        "percent": 100.0 * (after / before - 1.0) if before * after > 0.0 else None,
        "new": alarm.change.form == "step"
        and newest - float(series.time_s[alarm.change.first]) < SILENT.total_seconds(),
        "others": others,
        "trend": trend_of(alarm.judged, alarm.change, found.judged, plain=False),
        "span": (series.moment(0), series.moment(-1)),
    }


def _grown(found: Grown | str | None) -> str | None:
    """Return what grew, in words."""
    return f"What grew is {found.sentence}" if isinstance(found, Grown) else found


def _unlike(one: Unlike, links: _Links, numbers: dict[str, int]) -> dict[str, Any]:
    series = one.judged.series
    return _place(one.judged, numbers) | {
        "link": links.link(series.seen[-1], series.axis, series.moment(-1), "newest")
    }


def _explained(
    one: Explained, found: FleetChanges, links: _Links, numbers: dict[str, int]
) -> dict[str, Any]:
    series = one.judged.series
    return _place(one.judged, numbers) | {
        "form": one.judged.plain.form,
        "since": one.judged.since(one.judged.plain),
        "moved": one.moved,
        "left": one.remainder,
        "certain": one.certain,
        "link": links.link(series.seen[-1], series.axis, series.moment(-1), "newest"),
    }


def _overview(
    machines: dict[str, MachineSeen], found: FleetChanges, now: datetime
) -> list[dict[str, Any]]:
    """Return a row for each machine, those in which something changed first."""
    changed: dict[str, list[str]] = defaultdict(list)
    for alarm in found.alarms:
        changed[alarm.series.machine].append(f"{alarm.series.axis} {alarm.series.name}")
    unlike = Counter(one.judged.series.machine for one in found.unlike)
    tests = Counter(one.series.machine for one in found.judged)
    tests.update(one.series.machine for one in found.judged if one.standing is not None)
    all_tests = sum(tests.values())
    order = {name: k for k, name in reversed(list(enumerate(changed)))}
    rows = [
        {
            "name": machine.name,
            "number": number,
            "logs": len(machine.logs),
            "refused": len(machine.refused),
            "first": machine.first,
            "last": machine.last,
            "silent": machine.last is not None and now - machine.last > SILENT,
            "changed": changed.get(machine.name, []),
            "unlike": unlike[machine.name],
            "effects": sorted({name for axis in machine.axes.values() for name in axis.effects}),
            "false_alarms": found.false_alarms_a_year * tests[machine.name] / all_tests
            if all_tests
            else 0.0,
        }
        for number, machine in enumerate(machines.values())
    ]
    return sorted(
        rows, key=lambda row: (order.get(str(row["name"]), len(order)), -unlike[str(row["name"])])
    )


def _machines(
    machines: dict[str, MachineSeen], found: FleetChanges, links: _Links
) -> list[dict[str, Any]]:
    alarms = {id(alarm.judged) for alarm in found.alarms}
    unlike = {id(one.judged) for one in found.unlike}
    parameters: dict[tuple[str, str, str], list[dict[str, Any]]] = defaultdict(list)
    for one in found.judged:
        entry = _parameter(one.series, links) | {
            "standing": one.standing,
            "changed": id(one) in alarms,
            "unlike": id(one) in unlike,
        }
        parameters[one.series.machine, one.series.axis, one.series.program].append(entry)
    for series in found.unjudged:
        entry = _parameter(series, links) | {"standing": None, "changed": False, "unlike": False}
        parameters[series.machine, series.axis, series.program].append(entry)
    shown = []
    for name, machine in machines.items():
        own = {key[1:] for key in parameters if key[0] == name} | set(machine.axes)
        axes = [
            {
                "name": axis,
                "program": program,
                "parameters": parameters.get((name, axis, program), []),
                "seen": machine.axes[axis, program],
                "effects": _effects(machine, axis, program, links),
            }
            for axis, program in sorted(own)
            if axis
        ]
        shown.append(
            {
                "name": name,
                "axes": axes,
                "refused": machine.refused[-MOST_REFUSED:],
                "refused_more": max(0, len(machine.refused) - MOST_REFUSED),
            }
        )
    return shown


def _parameter(series: Series, links: _Links) -> dict[str, Any]:
    if not len(series.value):
        return {"name": series.name, "unit": series.unit, "level": None, "link": None, "line": ""}
    return {
        "name": series.name,
        "unit": series.unit,
        "level": latest_level(series.value),
        "line": small(series.value, series.time_s) if len(series.value) > 1 else "",
        "link": links.link(series.seen[-1], series.axis, series.moment(-1), "newest"),
    }


def _effects(
    machine: MachineSeen, axis: str, program: str, links: _Links
) -> Sequence[dict[str, Any]]:
    return [
        {
            "name": effect.name,
            "windows": effect.windows,
            "confidence": effect.confidence,
            "explained": effect.explained,
            "text": effect.text,
            "links": [
                links.link(seen[1], axis, seen[0], words)
                for seen, words in ((effect.first, "first"), (effect.last, "last"))
                if seen is not None
            ],
        }
        for effect in machine.axes[axis, program].effects.values()
    ]
