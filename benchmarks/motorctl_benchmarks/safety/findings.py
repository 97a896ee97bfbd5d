"""The campaign as a subject of the bench: which tasks it has, its figures, tables and failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.safety.bus_case import BusOutcome
from motorctl_benchmarks.safety.bus_cases import BUS, BusKey, bus_keys, parse_bus
from motorctl_benchmarks.safety.bus_faults import ENDS, TITLES
from motorctl_benchmarks.safety.bus_kills import KillOutcome
from motorctl_benchmarks.safety.bus_lines import EVERY_LINE
from motorctl_benchmarks.safety.bus_run import Outcome as RealOutcome
from motorctl_benchmarks.safety.bus_run import run_bus_cases
from motorctl_benchmarks.safety.bus_tables import bus_state_table, bus_table, end_table, kill_table
from motorctl_benchmarks.safety.cases import CaseKey, Size, keys, parse_case
from motorctl_benchmarks.safety.fault_free import Quiet, Spell, run_spell, spells
from motorctl_benchmarks.safety.machines import KINDS
from motorctl_benchmarks.safety.run_case import Outcome, run_case
from motorctl_benchmarks.safety.source import commit_words
from motorctl_benchmarks.safety.table import fault_table, quiet_table, state_table
from motorctl_benchmarks.worker_pool import run_tasks

Task = CaseKey | Spell
"""What runs in virtual time, on any CPU."""

NONE_WRONG = Target("value", "<=", 0.0)
FREE = "free"
FREE_PARTS = 4
BUS_SHARE = 0.3
"""Of the progress."""


@dataclass(frozen=True)
class SafetyOptions:
    """What is asked for."""

    size: Size = "small"
    seed: int = 1
    workers: int | None = None
    """As many as there are CPUs for this process, if not given."""
    out: Path | None = None
    """A file to which every case is written as a line of JSON."""
    only: tuple[Task | BusKey, ...] = ()
    """Nothing but these."""


def parse_task(text: str) -> Task | BusKey:
    """Read the key of a case or of a spell without a fault. Raises UsageError where it is none."""
    parts = text.split(":")
    if parts[0] == BUS:
        return parse_bus(text)
    if parts[0] != FREE:
        return parse_case(text)
    known = len(parts) == FREE_PARTS and parts[1] in KINDS and parts[2] in ("C1", "C2")
    if known and parts[3].isdecimal():
        return Spell(parts[1], parts[2], int(parts[3]))
    raise UsageError(f"{text}: no spell; free:MACHINE:CONTROLLER:SEED, as in free:stage:C2:1")


def parse_tasks(text: str) -> tuple[Task | BusKey, ...]:
    """Read a key, or all cases of a bus or a machine: bus:can-udp, dual. Raises UsageError."""
    bus, _, line = text.partition(":")
    if bus == BUS and line in EVERY_LINE:
        return tuple(key for key in bus_keys("full", 1) if key.line == line)
    if text in KINDS:
        return tuple(key for key in keys("full", 1) if key.machine == text)
    return (parse_task(text),)


def run_task(task: Task) -> Outcome | Quiet:
    """Run a case, or a spell without a fault."""
    return run_spell(task) if isinstance(task, Spell) else run_case(task)


def tasks_of(options: SafetyOptions) -> tuple[list[BusKey], list[Task]]:
    """Return the cases on buses, and what runs in virtual time, the long ones first."""
    if options.only:
        buses = [task for task in options.only if isinstance(task, BusKey)]
        return buses, [task for task in options.only if not isinstance(task, BusKey)]
    size, seed = options.size, options.seed
    return bus_keys(size, seed), [*spells(size, seed), *keys(size, seed)]


def safety_findings(progress: Progress, options: SafetyOptions) -> Findings:
    """Run the campaign and judge it; the buses first, in real time and with nothing beside them.

    Raises UsageError where a file cannot be written, RunError where a worker dies.
    """
    buses, tasks = tasks_of(options)
    shared = BUS_SHARE if tasks else 1.0
    commit = commit_words()  # before it runs: what is changed meanwhile is not what was measured
    on_buses = run_bus_cases(buses, part_of(progress, 0.0, shared)) if buses else []
    results: list[Outcome | Quiet] = []
    if tasks:
        rest = part_of(progress, shared if buses else 0.0, 1.0)
        results = run_tasks(run_task, tasks, rest, options.workers, options.out)
    outcomes = [result for result in results if isinstance(result, Outcome)]
    quiet = [result for result in results if isinstance(result, Quiet)]
    found = findings_of(outcomes, on_buses, quiet)
    return replace(found, head=head_line(found, options, commit))


def head_line(found: Findings, options: SafetyOptions, commit: str) -> str:
    """Return the line above the tables: what was run of which source, and what came of it."""
    what = "chosen cases" if options.only else f"size {options.size}, seed {options.seed}"
    numbers = {figure.name: figure.value for figure in found.figures}
    told = [f"Commit {commit}, {what}"]
    if "fault_cases" in numbers:
        cases, wrong = int(numbers["fault_cases"]), int(numbers["not_as_promised"])
        right = "all as promised" if not wrong else f"{wrong} of them NOT as promised"
        told.append(f"{cases} fault cases, {int(numbers['fault_cases_on_buses'])} of them over "
                    f"buses, {right}")  # fmt: skip
    if "hours_without_fault" in numbers:
        trips = int(numbers["false_trips"])
        told.append(f"{numbers['hours_without_fault']:.1f} h of virtual time without a fault, "
                    f"{trips or 'no'} false trip{'s' * (trips > 1)}")  # fmt: skip
    return ": ".join((told[0], "; ".join(told[1:]))) + "." if told[1:] else f"{told[0]}."


def findings_of(
    outcomes: Sequence[Outcome], on_buses: Sequence[RealOutcome], quiet: Sequence[Quiet]
) -> Findings:
    """Return figures, tables and failures of what was run."""
    tables: list[TextTable] = []
    wires = [o for o in on_buses if isinstance(o, BusOutcome)]
    kills = [o for o in on_buses if isinstance(o, KillOutcome)]
    if outcomes:
        tables += [fault_table(outcomes), state_table(outcomes)]
    ends = [o for o in wires if o.key.fault in ENDS]
    if wires := [o for o in wires if o.key.fault not in ENDS]:
        tables += [bus_table(wires), bus_state_table(wires)]
    if ends:
        tables.append(end_table(ends))
    if kills:
        tables.append(kill_table(kills))
    if quiet:
        tables.append(quiet_table(quiet))
    failures = [
        *(_failure(str(o.key), o.key.kind.title, o.failures) for o in outcomes if not o.right),
        *(_failure(str(o.key), TITLES[o.key.fault], o.failures) for o in on_buses if not o.right),
        *(_failure(str(q.spell), "no fault", (q.trip,)) for q in quiet if q.trip),
    ]
    return Findings(
        figures=tuple(_figures(outcomes, on_buses, quiet)),
        notes=tuple(_notes(outcomes)),
        mistakes=tuple(failures),
        data={
            "cases": [o.document() for o in outcomes] + [o.document() for o in on_buses],
            "spells": [spell.document() for spell in quiet],
            "tables": [_plain(table) for table in tables],
        },
        tables=tuple(tables),
        failed=bool(failures),
    )


def _failure(case: str, fault: str, failures: Sequence[str]) -> dict[str, str]:
    return {"case": case, "truth": fault, "answer": "; ".join(failures)}


def _figures(
    outcomes: Sequence[Outcome], on_buses: Sequence[RealOutcome], quiet: Sequence[Quiet]
) -> list[Figure]:
    figures: list[Figure] = []
    both: list[Outcome | RealOutcome] = [*outcomes, *on_buses]
    if both:
        wrong = sum(not outcome.right for outcome in both)
        missed = sum(any("missed" in why for why in o.failures) for o in both)
        lost = sum(outcome.rows_lost for outcome in both)
        figures += [
            Figure("fault_cases", "fault cases", len(both), "cases"),
            Figure("fault_cases_on_buses", "of these over buses", len(on_buses), "cases"),
            Figure("not_as_promised", "not as promised", wrong, "cases", target=NONE_WRONG),
            Figure("missed_faults", "detected by nothing", missed, "cases", target=NONE_WRONG),
            Figure("rows_lost", "rows of the logs lost", lost, "rows", target=NONE_WRONG),
        ]
    if quiet:
        trips = sum(bool(spell.trip) for spell in quiet)
        hours = sum(spell.hours for spell in quiet)
        figures += [
            Figure("hours_without_fault", "virtual time without a fault", hours, "h"),
            Figure("false_trips", "false trips in it", trips, "trips", target=NONE_WRONG),
        ]
    return figures


def _notes(outcomes: Sequence[Outcome]) -> list[str]:
    machines = dict.fromkeys(outcome.key.machine for outcome in outcomes)
    return [f"{name}: {KINDS[name].words}" for name in machines]


def _plain(table: TextTable) -> dict[str, object]:
    return {"title": table.title, "columns": list(table.columns), "rows": [*map(list, table.rows)]}
