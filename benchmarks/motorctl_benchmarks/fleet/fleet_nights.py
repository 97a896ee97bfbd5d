"""A simulated fleet: its logs are made and diagnosed, and what changed is asked every night.

Every night knows what was recorded until then, and no more. Logs are made a few days at a time and
removed once they are looked at, so that months of a fleet need little disk; any of them can be made
again.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
from distributed import Client

import motorctl
from motorctl.fleet.changes import Alarm, changes_in
from motorctl.fleet.cluster import engine
from motorctl.fleet.covariates import Covariates, read_covariates
from motorctl.fleet.grown import LOGS, what_grew
from motorctl.fleet.run import diagnose_fleet
from motorctl.fleet.series import Seen
from motorctl.fleet.store import Store, open_store
from motorctl.latency.progress import Progress
from motorctl_benchmarks.diagnosis.answer import in_one_line
from motorctl_benchmarks.fleet.fleet_logs import BEGAN, write_log
from motorctl_benchmarks.fleet.fleet_machines import (
    KINDS,
    Machine,
    axis_on,
    hall_k,
    log_times,
    lubricant,
    run_log,
    thermometer_k,
)
from motorctl_benchmarks.fleet.own_cluster import address_of

LOGS_AT_ONCE = 400
"""Made before they are looked at: half a gigabyte."""
RECORDING = 0.95
"""Share of the whole that making and diagnosing logs is. For progress alone."""
FINDINGS = "findings"
READINGS = "temperatures.csv"
READINGS_A_DAY = 24
"""Of a thermometer beside every machine."""
LACKS = "residual_rms"
"""What the fit leaves: where this is what changed, the log to look at is diagnosed for a name."""


@dataclass(frozen=True)
class Fleet:
    """The machines, and how long and often they record."""

    machines: tuple[Machine, ...]
    days: int
    logs_a_day: int
    seed: int

    def document(self) -> dict[str, Any]:
        """Return the whole truth as plain data."""
        return {
            "days": self.days,
            "logs_a_day": self.logs_a_day,
            "seed": self.seed,
            "began": BEGAN.isoformat(),
            "right_names": {
                kind: {"parameters": sorted(told.names), "effects": sorted(told.effects)}
                for kind, told in KINDS.items()
            },
            "machines": [machine.document() for machine in self.machines],
        }


@dataclass(frozen=True)
class Told:
    """A change that a night told of a machine."""

    parameter: str
    form: str
    since_day: float
    """When it says that it began, in days of the fleet."""
    size: float
    log: str
    before: tuple[Seen, ...]
    """Windows of the last points before it."""
    after: tuple[Seen, ...]


@dataclass
class Nights:
    """What every night told, and what the machines' errors were meanwhile."""

    told: list[dict[str, list[Told]]] = field(default_factory=list)
    """Of each night, by machine, first what is to be looked at first."""
    unlike: list[dict[str, list[str]]] = field(default_factory=list)
    """Of each night, by machine, the parameters that it calls unlike its siblings'."""
    tracking_m: dict[str, list[float]] = field(default_factory=dict)
    """Of each machine the mean over each day's logs."""
    named: dict[str, str] = field(default_factory=dict)
    """What a diagnosis said of a log that a machine's first alarm points to."""
    refused: list[str] = field(default_factory=list)
    logs: int = 0
    judged: int = 0
    """Series in the last night."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Spent on making, diagnosing and judging."""

    @contextmanager
    def timed(self, what: str) -> Iterator[None]:
        """Add up what something takes."""
        began = time.monotonic()
        yield
        self.seconds[what] = self.seconds.get(what, 0.0) + time.monotonic() - began


def make_log(fleet: Fleet, place: int, number: int, folder: str) -> float:
    """Write a log of a machine, and return its tracking error [m]."""
    machine = fleet.machines[place]
    day = float(log_times(machine, fleet.days, fleet.logs_a_day)[number])
    friction = float(lubricant(machine, fleet.days * fleet.logs_a_day)[number])
    warm_k = float(hall_k(np.array([day]), fleet.seed)[0])
    run = run_log(machine, number, axis_on(machine, day, friction, warm_k, fleet.days))
    write_log(log_path(Path(folder), machine, number), machine, day, run)
    return run.tracking_m


def log_path(folder: Path, machine: Machine, number: int) -> Path:
    """Return where a log of a machine is written."""
    return folder / machine.name / f"{number:05d}.parquet"


def live(fleet: Fleet, folder: Path, workers: int | None, progress: Progress) -> Nights:
    """Let a fleet run for all of its days, and ask every night what changed.

    Parameters
    ----------
    fleet
        Whose truth is written to `truth.json` before anything else happens, and what thermometers
        beside the machines read to `temperatures.csv`.
    folder
        Of truth, store and logs.
    workers
        Processes; None: one a CPU.
    progress
        Told the share that is done.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "truth.json").write_text(json.dumps(fleet.document(), indent=1) + "\n")
    _write_readings(fleet, folder / READINGS)
    nights = Nights(tracking_m={machine.name: [] for machine in fleet.machines})
    at_once = max(1, LOGS_AT_ONCE // (len(fleet.machines) * fleet.logs_a_day))
    with engine(None, workers) as client:
        for first in range(0, fleet.days, at_once):
            days = range(first, min(first + at_once, fleet.days))
            _record(fleet, days, folder, client, nights)
            progress(RECORDING * days.stop / fleet.days)
    ask_every_night(fleet, folder / FINDINGS, nights, read_covariates(folder / READINGS))
    _name_what_is_lacking(fleet, folder, nights)
    progress(1.0)
    return nights


def _record(fleet: Fleet, days: range, folder: Path, client: Client, nights: Nights) -> None:
    """Make the logs of some days, and give them to `fleet diagnose`."""
    logs = folder / "logs"
    numbers = range(days.start * fleet.logs_a_day, days.stop * fleet.logs_a_day)
    places = range(len(fleet.machines))
    with nights.timed("making logs"):
        futures = [
            client.submit(make_log, fleet, place, number, str(logs), pure=False)
            for place in places
            for number in numbers
        ]
        errors = np.reshape(client.gather(futures), (len(places), len(days), fleet.logs_a_day))
    for machine, of_days in zip(fleet.machines, errors.mean(axis=2), strict=True):
        nights.tracking_m[machine.name] += of_days.tolist()
    with nights.timed("fleet diagnose"):
        run = diagnose_fleet(
            [f"{logs}/*/*.parquet"], folder / FINDINGS, diagnoses=0, scheduler=address_of(client)
        )
    nights.logs += run.logs
    nights.refused += [each.reason for each in run.refused]
    shutil.rmtree(logs)


def _write_readings(fleet: Fleet, file: Path) -> None:
    """Write what a thermometer beside every machine reads, as users give it to `fleet changes`."""
    times = np.arange(fleet.days * READINGS_A_DAY + 1) / READINGS_A_DAY
    lines = ["machine,time,temperature_K"]
    for machine in fleet.machines:
        told = thermometer_k(machine, times, fleet.days, fleet.seed)
        lines += [
            f"{machine.name},{(BEGAN + timedelta(days=float(day))).isoformat()},{value:.2f}"
            for day, value in zip(times, told, strict=True)
        ]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def ask_every_night(fleet: Fleet, store: Path, nights: Nights, beside: Covariates) -> None:
    """Ask `fleet changes` at the end of each day, with what began before."""
    findings = open_store(store).read()
    with nights.timed("fleet changes"):
        for day in range(fleet.days):
            then = _StoreThen(store, findings, BEGAN + timedelta(days=day + 1))
            found = changes_in(then, covariates=beside)
            nights.judged = found.series
            by_machine: dict[str, list[Told]] = {}
            for alarm in found.alarms:
                by_machine.setdefault(alarm.series.machine, []).append(_told(alarm))
            nights.told.append(by_machine)
            apart: dict[str, list[str]] = {}
            for one in found.unlike:
                apart.setdefault(one.judged.series.machine, []).append(one.judged.series.name)
            nights.unlike.append(apart)


class _StoreThen(Store):
    """A store as it was at a time."""

    def __init__(self, folder: Path, findings: pa.Table, end: datetime) -> None:
        super().__init__(folder)
        began = findings.column("begin_utc")
        self._then = findings.filter(pc.less(began, pa.scalar(end, began.type)))

    def read(
        self, columns: list[str] | None = None, where: ds.Expression | None = None
    ) -> pa.Table:
        found = self._then if where is None else self._then.filter(where)
        return found if columns is None else found.select(columns)


def _told(alarm: Alarm) -> Told:
    since = (alarm.since[0 if alarm.change.form == "drift" else 1] - BEGAN).total_seconds()
    series = alarm.series
    change = alarm.change
    around = alarm.around(LOGS)
    return Told(series.name, change.form, since / 86400.0, change.size, alarm.log, *around)


def first_told(machine: Machine, nights: Nights) -> int | None:
    """Return the first night after a change began in which something new is told; else None."""
    if machine.form == "none":
        return None
    known: set[str] = set()
    for night, told in enumerate(nights.told):
        names = {each.parameter for each in told.get(machine.name, ())}
        if night + 1 > machine.onset_day and names - known:
            return night
        known = names
    return None


def new_in(machine: Machine, nights: Nights, night: int) -> list[Told]:
    """Return what a night tells of a machine that the night before did not."""
    before = nights.told[night - 1].get(machine.name, []) if night else []
    known = {each.parameter for each in before}
    return [
        each for each in nights.told[night].get(machine.name, []) if each.parameter not in known
    ]


def _name_what_is_lacking(fleet: Fleet, folder: Path, nights: Nights) -> None:
    """Name what grew where the fit's residual did, as `fleet changes` does; else diagnose the log.

    That is what `changes` suggests where it has no name.
    """
    again = folder / "again"
    for place, machine in enumerate(fleet.machines):
        night = first_told(machine, nights)
        if night is None:
            continue
        first = new_in(machine, nights, night)[0]
        if first.parameter != LACKS:
            continue

        def made(seen: Seen, place: int = place, machine: Machine = machine) -> Seen:
            number = int(Path(seen.source).stem)
            make_log(fleet, place, number, str(again))
            return replace(seen, source=str(log_path(again, machine, number)))

        before, after = (
            [made(seen) for seen in windows] for windows in (first.before, first.after)
        )
        try:
            grown = what_grew(before, after, "x")
            if grown is not None:
                nights.named[machine.name] = grown.name
                continue
            path = log_path(again, machine, int(Path(first.log).stem))
            axis = motorctl.diagnose(path).axes["x"]
            said = [effect.name for effect in axis.effects]
            nights.named[machine.name] = ", ".join(said) or axis.verdict
        except Exception as error:  # whatever it is, it is this machine's answer
            nights.named[machine.name] = in_one_line(error)
    shutil.rmtree(again, ignore_errors=True)
