"""The campaign: its cases in worker processes, each on one thread, results as they come."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from motorctl.errors import RunError, UsageError
from motorctl.latency.progress import Progress
from motorctl_benchmarks.diagnosis.groups import HELD_OUT_SEED, CaseKey, Size, keys
from motorctl_benchmarks.diagnosis.known_effects import KNOWN
from motorctl_benchmarks.diagnosis.run_case import Outcome, Task, run_task

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
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
    tasks = tasks_of(options)
    workers = options.workers or len(os.sched_getaffinity(0))
    done: dict[Task, Outcome] = {}
    with contextlib.ExitStack() as stack:
        out = stack.enter_context(_opened(options.out))
        _make(options.logs)
        stack.enter_context(_one_thread_each())
        # A forked process would share the threads' locks of this one.
        pool = ProcessPoolExecutor(
            min(workers, len(tasks)), mp_context=multiprocessing.get_context("spawn")
        )
        stack.enter_context(pool)
        futures = {pool.submit(run_task, task): task for task in tasks}
        try:
            for future in as_completed(futures):
                outcome = future.result()
                done[futures[future]] = outcome
                if out is not None:
                    out.write(json.dumps(outcome.document()) + "\n")
                    out.flush()
                progress(len(done) / len(tasks))
        except BrokenProcessPool as error:
            raise RunError(
                f"a worker process died after {len(done)} of {len(tasks)} cases; where memory is "
                "short, fewer --workers help"
            ) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return [done[task] for task in tasks]


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that are started meanwhile compute on one thread: there is one a CPU."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _opened(path: Path | None) -> Iterator[TextIO | None]:
    if path is None:
        yield None
        return
    try:
        file = path.open("w", encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    with file:
        yield file


def _make(folder: Path | None) -> None:
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror}") from error
