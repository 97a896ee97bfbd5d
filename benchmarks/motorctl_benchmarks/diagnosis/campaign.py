"""The campaign: which cases it has, and what is done with each beside its diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.latency.progress import Progress
from motorctl_benchmarks.diagnosis.groups import HELD_OUT_SEED, CaseKey, Size, keys
from motorctl_benchmarks.diagnosis.known_effects import KNOWN
from motorctl_benchmarks.diagnosis.run_case import Outcome, Task, run_task
from motorctl_benchmarks.worker_pool import run_tasks

CLOSED_LOOPS: dict[Size, int] = {"small": 1, "full": 2}
"""How many cases of each effect are refined and driven."""
PEER_GROUPS = ("one", "clean", "unknown", "several")
PEER_CASES: dict[Size, int] = {"small": 5, "full": 34}
"""How many cases of each of these groups the peers are given as well."""


@dataclass(frozen=True)
class CampaignOptions:
    """What is asked for."""

    size: Size = "small"
    cases: int | None = None
    """In each group, in place of the size's own numbers."""
    first_seed: int = HELD_OUT_SEED
    workers: int | None = None
    """As many as there are CPUs for this process, if not given."""
    out: Path | None = None
    """A file to which every case is written as a line of JSON."""
    logs: Path | None = None
    """A folder in which the logs are kept."""
    plot: Path | None = None
    """A picture of how often names were right over their confidence."""
    only: tuple[CaseKey, ...] = ()
    """Nothing but these cases."""


def tasks_of(options: CampaignOptions) -> list[Task]:
    """Return every task, in the order in which they are begun."""
    if options.only:
        return [Task(key, key.group == "one", True, options.logs) for key in options.only]
    tasks, counted = [], dict.fromkeys(PEER_GROUPS, 0)
    loops = CLOSED_LOOPS[options.size] * len(KNOWN)
    for key in keys(options.size, options.cases, options.first_seed):
        asked = key.group in counted and counted[key.group] < PEER_CASES[options.size]
        if asked:
            counted[key.group] += 1
        driven = key.group == "one" and loops > 0
        loops -= driven
        tasks.append(Task(key, driven, asked, options.logs))
    return tasks


def run_campaign(options: CampaignOptions, progress: Progress) -> list[Outcome]:
    """Run every task; return the outcomes in the tasks' order.

    Raises UsageError where a file or folder cannot be written, RunError where a worker dies.
    """
    _make(options.logs)
    return run_tasks(run_task, tasks_of(options), progress, options.workers, options.out)


def _make(folder: Path | None) -> None:
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror}") from error
