"""The campaign as a subject of the bench: which tasks it has, its figures, tables and failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.safety.cases import CaseKey, Size, keys, parse_case
from motorctl_benchmarks.safety.fault_free import Quiet, Spell, run_spell, spells
from motorctl_benchmarks.safety.machines import KINDS
from motorctl_benchmarks.safety.run_case import Outcome, run_case
from motorctl_benchmarks.safety.table import fault_table, quiet_table, state_table
from motorctl_benchmarks.worker_pool import run_tasks

Task = CaseKey | Spell

NONE_WRONG = Target("value", "<=", 0.0)
FREE = "free"
FREE_PARTS = 4


@dataclass(frozen=True)
class SafetyOptions:
    """What is asked for."""

    size: Size = "small"
    seed: int = 1
    workers: int | None = None
    """As many as there are CPUs for this process, if not given."""
    out: Path | None = None
    """A file to which every case is written as a line of JSON."""
    only: tuple[Task, ...] = ()
    """Nothing but these."""


def parse_task(text: str) -> Task:
    """Read the key of a case or of a spell without a fault. Raises UsageError where it is none."""
    parts = text.split(":")
    if parts[0] != FREE:
        return parse_case(text)
    known = len(parts) == FREE_PARTS and parts[1] in KINDS and parts[2] in ("C1", "C2")
    if known and parts[3].isdecimal():
        return Spell(parts[1], parts[2], int(parts[3]))
    raise UsageError(f"{text}: no spell; free:MACHINE:CONTROLLER:SEED, as in free:stage:C2:1")


def run_task(task: Task) -> Outcome | Quiet:
    """Run a case, or a spell without a fault."""
    return run_spell(task) if isinstance(task, Spell) else run_case(task)


def tasks_of(options: SafetyOptions) -> list[Task]:
    """Return every task; the long ones first."""
    if options.only:
        return list(options.only)
    return [*spells(options.size, options.seed), *keys(options.size, options.seed)]


def safety_findings(progress: Progress, options: SafetyOptions) -> Findings:
    """Run the campaign and judge it.

    Raises UsageError where a file cannot be written, RunError where a worker dies.
    """
    tasks = tasks_of(options)
    results = run_tasks(run_task, tasks, progress, options.workers, options.out)
    outcomes = [result for result in results if isinstance(result, Outcome)]
    quiet = [result for result in results if isinstance(result, Quiet)]
    return findings_of(outcomes, quiet)


def findings_of(outcomes: Sequence[Outcome], quiet: Sequence[Quiet]) -> Findings:
    """Return figures, tables and failures of what was run."""
    tables: list[TextTable] = []
    if outcomes:
        tables += [fault_table(outcomes), state_table(outcomes)]
    if quiet:
        tables.append(quiet_table(quiet))
    figures = tuple(_figures(outcomes, quiet))
    failures = [
        *({"case": str(o.key), "truth": o.key.kind.title, "answer": "; ".join(o.failures)}
          for o in outcomes if not o.right),
        *({"case": str(q.spell), "truth": "no fault", "answer": q.trip} for q in quiet if q.trip),
    ]  # fmt: skip
    return Findings(
        figures=figures,
        notes=tuple(_notes(outcomes)),
        mistakes=tuple(failures),
        data={
            "cases": [outcome.document() for outcome in outcomes],
            "spells": [spell.document() for spell in quiet],
            "tables": [_plain(table) for table in tables],
        },
        tables=tuple(tables),
        failed=bool(failures),
    )


def _figures(outcomes: Sequence[Outcome], quiet: Sequence[Quiet]) -> list[Figure]:
    figures = []
    if outcomes:
        wrong = sum(not outcome.right for outcome in outcomes)
        missed = sum(any("missed" in why for why in o.failures) for o in outcomes)
        lost = sum(outcome.rows_lost for outcome in outcomes)
        figures += [
            Figure("fault_cases", "fault cases", len(outcomes), "cases"),
            Figure("not_as_promised", "not as promised", wrong, "cases", target=NONE_WRONG),
            Figure("missed_faults", "faults that nothing detected", missed, "cases", target=NONE_WRONG),
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
