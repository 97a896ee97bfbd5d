"""`motorctl bench fleet`: whether what changes in a fleet is told, in time and rightly."""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.fleet.disturbances import (
    undisturbed,
    with_killed_scheduler,
    with_killed_workers,
    with_refusing_store,
)
from motorctl_benchmarks.fleet.fleet_machines import KINDS, LOG_S, draw_fleet
from motorctl_benchmarks.fleet.fleet_nights import Fleet, Nights, live, make_log
from motorctl_benchmarks.fleet.fleet_score import STEP_DAYS, Outcome, outcome_of
from motorctl_benchmarks.fleet.scaling import scheduling_s, throughputs

FEWEST_DAYS = 8
PARTS = ("nights", "disturbances", "scaling")
KILLS = 30
SCHEDULERS_KILLED = 3
ONE_IN = 20
"""Requests of which the store refuses one."""
DISTURBED_LOGS = 48
SCALED_LOGS = 32
TINY_TASKS = 100_000
WITHIN_PERCENT = 15.0


@dataclass(frozen=True)
class FleetOptions:
    """What is asked for."""

    machines: int = 12
    days: int = 20
    logs_a_day: int = 3
    seed: int = 1
    workers: int | None = None
    only: tuple[str, ...] = ()
    """Parts; the nights where none is named."""
    out: Path | None = None
    folder: Path | None = None
    """Where truth and findings are kept."""

    def __post_init__(self) -> None:
        """Look at the numbers."""
        if self.days < FEWEST_DAYS:
            raise UsageError(f"--days {self.days}: should be {FEWEST_DAYS} or more")
        for part in self.only:
            if part not in PARTS:
                raise UsageError(f"--only {part}: the parts are {', '.join(PARTS)}")
        if self.folder is not None and self.folder.exists() and any(self.folder.iterdir()):
            raise UsageError(f"{self.folder}: is there already: name a new folder")


def fleet_findings(progress: Progress, options: FleetOptions) -> Findings:
    """Measure the parts that are asked for, one after the other."""
    asked = [part for part in PARTS if part in (options.only or PARTS[:1])]
    found = []
    for k, part in enumerate(asked):
        own = part_of(progress, k / len(asked), (k + 1) / len(asked))
        with tempfile.TemporaryDirectory(prefix="motorctl-") as scratch:
            folder = options.folder / part if options.folder else Path(scratch)
            if part == "nights":
                found.append(_nights(own, options, folder))
            elif part == "disturbances":
                found.append(_disturbances(own, options, folder))
            else:
                found.append(_scaling(own, options, folder))
    return Findings(
        tuple(figure for each in found for figure in each.figures),
        tuple(note for each in found for note in each.notes),
        data={key: value for each in found for key, value in each.data.items()},
        tables=tuple(table for each in found for table in each.tables),
    )


def _nights(progress: Progress, options: FleetOptions, folder: Path) -> Findings:
    machines = draw_fleet(options.machines, options.days, options.seed)
    fleet = Fleet(tuple(machines), options.days, options.logs_a_day, options.seed)
    began = time.monotonic()
    nights = live(fleet, folder, options.workers, progress)
    taken = time.monotonic() - began
    outcomes = [outcome_of(machine, fleet, nights) for machine in fleet.machines]
    if options.out is not None:
        lines = [json.dumps(outcome.document()) for outcome in outcomes]
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return found_of(fleet, nights, outcomes, taken)


def some_logs(folder: Path, count: int, seed: int) -> Path:
    """Write logs of two machines, and return their folder."""
    a_day = math.ceil(count / 2 / FEWEST_DAYS)
    fleet = Fleet(tuple(draw_fleet(2, FEWEST_DAYS, seed)), FEWEST_DAYS, a_day, seed)
    for k in range(count):
        make_log(fleet, k % 2, k // 2, str(folder))
    return folder


def _disturbances(progress: Progress, options: FleetOptions, folder: Path) -> Findings:
    workers = options.workers or 2
    logs, whole = some_logs(folder / "logs", DISTURBED_LOGS, options.seed), folder / "whole"
    undisturbed(logs, whole, workers)
    progress(0.1)
    found = [
        with_killed_workers(logs, whole, folder, kills=KILLS, workers=workers, seed=options.seed)
    ]
    progress(0.7)
    found.append(
        with_killed_scheduler(
            logs, whole, folder / "scheduler", kills=SCHEDULERS_KILLED, workers=workers
        )
    )
    progress(0.8)
    notes = []
    if all(find_spec(name) for name in ("moto", "s3fs", "werkzeug")):
        found.append(
            with_refusing_store(logs, whole, folder / "s3", one_in=ONE_IN, workers=workers)
        )
    else:
        notes.append("the store that refuses was left out: it needs s3fs and moto[s3,server]")
    rows = [
        (each.what, str(each.how_often), str(each.runs), str(each.logs), str(each.other))
        for each in found
    ]
    figure = Figure(
        "other_findings", "logs whose findings are other than undisturbed, but for times",
        float(sum(each.other for each in found)), "", target=Target("value", "<=", 0.0),
    )  # fmt: skip
    columns = ("what", "how often", "runs of the command", "logs compared", "other findings")
    progress(1.0)
    return Findings(
        (figure,),
        tuple(notes),
        data={"disturbances": [each.document() for each in found]},
        tables=(TextTable("disturbances", columns, tuple(rows)),),
    )


def _scaling(progress: Progress, options: FleetOptions, folder: Path) -> Findings:
    logs = some_logs(folder / "logs", SCALED_LOGS, options.seed)
    found = throughputs(logs, folder)
    progress(0.6)
    tiny_s = scheduling_s(TINY_TASKS)
    first = found[0].logs_a_worker_second
    figures = [
        Figure(
            f"worker_of_{each.workers}",
            f"logs a second of processor time of one of {each.workers} workers, beside one alone",
            100.0 * (each.logs_a_worker_second / first - 1.0), "%",
            target=Target("value", ">=", -WITHIN_PERCENT),
        )
        for each in found[1:]
    ]  # fmt: skip
    figures.append(
        Figure("tiny_task", f"processor time of client and scheduler a task, of {TINY_TASKS} tiny",
               1e3 * tiny_s, "ms")
    )  # fmt: skip
    rows = tuple(
        (
            str(each.workers),
            str(each.logs),
            f"{each.logs_a_worker_second:.2f}",
            f"{each.logs_a_worker_second / first:.2f}",
            f"{1e3 * each.client_s / each.logs:.1f}",
        )
        for each in found
    )
    columns = ("workers", "logs", "logs a second of a worker's processor time", "beside one worker",
               "client and scheduler, ms a log")  # fmt: skip
    progress(1.0)
    return Findings(tuple(figures), (), tables=(TextTable("scaling", columns, rows),))


def found_of(fleet: Fleet, nights: Nights, outcomes: Sequence[Outcome], taken_s: float) -> Findings:
    """Return figures and tables."""
    steps = [each for each in outcomes if each.form == "step"]
    drifts = [each for each in outcomes if each.form == "drift"]
    told = [each for each in (*steps, *drifts) if each.told_day is not None]
    false = sum(len(each.false_alarms) for each in outcomes)
    sound_days = sum(each.sound_days for each in outcomes)
    figures = (
        _share("steps", f"steps told within {STEP_DAYS:g} days",
               sum(bool(each.in_time) for each in steps), len(steps), 100.0),
        _share("drifts", "drifts told before they cost 20 % of the tracking error",
               sum(bool(each.in_time) for each in drifts), len(drifts), 100.0),
        _share("names", "right names, of changes that were told",
               sum(bool(each.right) for each in told), len(told), 90.0),
        Figure("false_alarms", f"false alarms in 1,000 machine-days ({false} in {sound_days})",
               1000.0 * false / max(sound_days, 1), "", target=Target("value", "<=", 1.0)),
    )  # fmt: skip
    spent = ", ".join(f"{what} {seconds:.0f} s" for what, seconds in nights.seconds.items())
    notes = (
        f"{len(fleet.machines)} machines, {fleet.days} days, {fleet.logs_a_day} logs of {LOG_S:g} "
        f"s a day, seed {fleet.seed}: {nights.logs} logs in {taken_s:.0f} s ({spent}); "
        f"{nights.judged} series were judged in the last night.",
        f"{len(nights.refused)} logs were refused.",
        *nights.refused[:5],
    )
    return Findings(
        figures,
        notes,
        data={"outcomes": [each.document() for each in outcomes]},
        tables=(_kinds(outcomes), _machines(outcomes)),
    )


def _share(name: str, title: str, good: int, all_of: int, wanted: float) -> Figure:
    value = 100.0 * good / all_of if all_of else math.nan
    return Figure(
        name, f"{title} ({good} of {all_of})", value, "%", target=Target("value", ">=", wanted)
    )


def _kinds(outcomes: Sequence[Outcome]) -> TextTable:
    rows = []
    for kind in (*KINDS, "sound"):
        mine = [each for each in outcomes if each.kind == kind]
        if not mine:
            continue
        told = [each for each in mine if each.told_day is not None]
        changes = mine[0].form != "none"
        rows.append((
            kind,
            mine[0].form if changes else "",
            str(len(mine)),
            str(len(told)) if changes else "",
            str(sum(bool(each.in_time) for each in mine)) if changes else "",
            str(sum(bool(each.right) for each in told)) if changes else "",
            str(sum(len(each.false_alarms) for each in mine)),
        ))  # fmt: skip
    columns = ("what happens", "form", "machines", "told", "in time", "right name", "false alarms")
    return TextTable("by what happens to a machine", columns, tuple(rows))


def _machines(outcomes: Sequence[Outcome]) -> TextTable:
    rows = [
        (
            each.machine,
            each.kind,
            _day(each.onset_day),
            _day(each.told_day),
            f"{_day(each.costly_day)}",
            f"{each.cost:.2f}",
            each.first,
            {True: "yes", False: "no", None: ""}[each.right],
            "; ".join(each.false_alarms),
        )
        for each in outcomes
    ]
    columns = (
        "machine", "what happens", "from day", "told", "costs 20 %", "error at the end, ratio",
        "to be looked at first", "right", "false alarms",
    )  # fmt: skip
    return TextTable("by machine", columns, tuple(rows))


def _day(day: float | None) -> str:
    return "" if day is None else f"{day:.1f}"
